"""A base of ROS 2, by DDS and without ROS: a twist out, its motion sensors and odometry in.

| file               | what                                       |
|--------------------|--------------------------------------------|
| `messages.py`      | its messages, byte by byte as ROS has them |
| `ports.py`         | its topics, by Cyclone DDS                 |
| `ros2_follower.py` | the link                                   |

What is believed of it and what it is told is decided without a socket: `link/base_end.py`.
"""
