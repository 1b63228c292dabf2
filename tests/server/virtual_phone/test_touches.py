"""TOUCHes that are said again are newer to the server, not to the finger."""

from server.protocol.wire_records import Record, Touch
from server.virtual_phone.touches import NEWEST_TOUCH_US, Touches

HELD = Touch(True, True, 4, 11)


def test_the_newest_is_said_again_with_the_new_nonce_and_the_next_number():
    touches = Touches()
    touches.numbered(1_000, Touch(False, True, 3, 10))
    assert touches.numbered(2_000, HELD) == Record(2, 2_000, HELD)
    assert touches.again(3_000, 12) == Record(3, 3_000, Touch(True, True, 4, 12))
    assert touches.numbered(4_000, HELD).sequence == 4


def test_an_old_one_is_not_said_again_however_often_the_newer_were():
    touches = Touches()
    assert touches.again(0, 1) is None
    touches.numbered(0, HELD)
    assert touches.again(NEWEST_TOUCH_US, 12) is not None
    assert touches.again(NEWEST_TOUCH_US + 1, 13) is None
