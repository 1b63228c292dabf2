"""An autopilot of PX4 or ArduPilot, by MAVLink over UDP: set-points out, how it moves in.

| file                  | what                                                                   |
|-----------------------|------------------------------------------------------------------------|
| `messages.py`         | the layouts of ten messages                                            |
| `packets.py`          | bytes ↔ messages, MAVLink 1 and 2                                      |
| `axes.py`             | its axes and ours                                                      |
| `time_sync.py`        | its clock and ours                                                     |
| `pilot.py`            | whether it follows set-points                                          |
| `autopilot_end.py`    | who it is, what is believed of it, what it is told: without a socket   |
| `mavlink_follower.py` | the link                                                               |

All of it is written from the protocol's definition, for ten messages need no library. Bytes only:
no PX4 and no ArduPilot has flown by it.
"""
