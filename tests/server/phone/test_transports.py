"""Pictures by two ways: those of one count, and a change begins with a key picture."""

from server.phone.transports import KEY_WANTED, ImageTransport, Transports
from server.protocol.wire import decode
from server.protocol.wire_records import Credit
from tests.server.web.test_session_manager import Fast


class Page:
    def __init__(self):
        self.data = []

    def send(self, data):
        self.data.append(data)

    send_newest = send

    @property
    def credits(self):
        return [decode(data).body for data in self.data]


def house():
    paths, operator, video, fast = Transports(lambda _: None), Page(), Page(), Fast()
    paths.begin(operator)
    paths.join_video(video)
    paths.use(fast)
    return paths, operator, video, fast


FAST, SOCKET = True, False


def test_the_way_changes_only_with_a_key_picture_taken_after_all_that_were_seen():
    way = ImageTransport()
    story = [
        (SOCKET, 10, True, True),
        (SOCKET, 20, False, True),
        (FAST, 30, False, False),  # leans on pictures that nobody has
        (FAST, 20, True, False),  # was seen already
        (FAST, 40, True, True),
        (SOCKET, 35, True, False),  # a straggler
        (SOCKET, 50, False, False),
        (FAST, 60, False, True),
        (SOCKET, 70, True, True),  # the fast way has ended
        (FAST, 65, False, False),
        (SOCKET, 80, False, True),
    ]
    for is_fast, t_us, key, taken in story:
        assert way.takes(is_fast, t_us, key) == taken, (is_fast, t_us, key)


def test_stragglers_of_the_websocket_are_given_back_and_ask_for_a_key_where_none_else_comes():
    paths, operator, video, fast = house()
    assert paths.pictures.takes(FAST, 40, True)
    assert not paths.takes_from_socket(50, 7, False)
    assert video.credits == [Credit(7)]
    assert (operator.data, fast.keys) == ([], 0)  # the page is about to change
    fast.has_video = False
    assert not paths.takes_from_socket(60, 8, False)
    assert (operator.data, fast.keys) == ([KEY_WANTED], 1)


def test_a_fast_way_that_can_not_take_over_is_asked_for_a_key_but_not_for_each_picture():
    paths, _, _, fast = house()
    assert paths.takes_from_fast(10, True)
    assert paths.takes_from_socket(20, 1, True)  # the page had not stopped yet
    assert not any(paths.takes_from_fast(t_us, False) for t_us in (30, 40, 50))
    assert fast.keys == 1
    assert paths.takes_from_fast(60, True)


def test_credit_is_for_pictures_of_the_websocket():
    paths, _, video, _ = house()
    paths.taken(3)
    assert paths.pictures.takes(FAST, 40, True)
    paths.taken(4)
    assert video.credits == [Credit(3)]


def test_a_ping_goes_by_all_ways_that_are_open():
    paths, operator, _, fast = house()
    paths.ping(b"one")
    paths.leave(fast)
    paths.ping(b"two")
    assert (operator.data, fast.data) == ([b"one", b"two"], [b"one"])


def test_nothing_is_said_to_a_phone_that_has_gone():
    paths, operator, video, fast = house()
    paths.close()
    assert fast.closed
    for say in (paths.want_key, lambda: paths.ping(b"p"), lambda: paths.taken(1)):
        say()
    assert operator.data == video.data == fast.data == []
