"""An arm of Franka's, by its vendor's library: a twist out, how its end effector moves in.

| file                 | what                                                                     |
|----------------------|--------------------------------------------------------------------------|
| `arm_end.py`         | what is believed of the arm, what it is told: without the library        |
| `arm_line.py`        | the library, in a thread of its own                                      |
| `joint_rates.py`     | how fast its joints turn, by where they were                             |
| `franka_follower.py` | the link                                                                 |
"""
