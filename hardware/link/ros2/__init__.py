"""A base of ROS 2, by DDS and without ROS: a twist out, its motion sensors and odometry in.

| file               | what                                                                       |
|--------------------|----------------------------------------------------------------------------|
| `base_end.py`      | who the base is, what is believed of it, what it is told: without a socket |
| `messages.py`      | its messages, byte by byte as ROS has them                                 |
| `ports.py`         | its topics, by Cyclone DDS                                                 |
| `ros2_follower.py` | the link                                                                   |
"""
