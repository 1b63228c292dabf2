"""A new aiortc either still takes our parts, or this says what has changed."""

import asyncio

import pytest
from aiortc import RTCConfiguration, RTCPeerConnection
from aiortc.rtcrtpsender import RTCRtpSender

from server.rtc import compatibility_check
from server.rtc.receiver_adapter import ReceiverAdapter
from server.virtual_phone.rtc_client import RTP_TIMESTAMP


def with_connection(talk):
    async def run():
        connection = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        try:
            return talk(connection.addTransceiver("video"))
        finally:
            await connection.close()

    return asyncio.run(run())


def test_the_installed_aiortc_takes_our_parts():
    assert (
        with_connection(lambda transceiver: compatibility_check.misfits(transceiver.receiver)) == []
    )


def test_its_own_parts_have_the_shape_of_ours():
    def look(transceiver):
        receiver = transceiver.receiver
        stock = [getattr(receiver, name) for name in compatibility_check.REPLACED]
        intake = ReceiverAdapter(receiver, lambda *_: True, lambda _: None, lambda: None)
        ours = [getattr(receiver, name) for name in compatibility_check.REPLACED]
        assert ours[0] is intake
        assert ours[2] is None
        assert callable(stock[0].add)
        assert callable(ours[0].add)
        assert isinstance(stock[1].missing, set)
        assert isinstance(ours[1].missing, set)

    with_connection(look)


def test_the_sender_of_the_virtual_phone_tells_its_time_stamp():
    assert with_connection(lambda transceiver: hasattr(transceiver.sender, RTP_TIMESTAMP))
    assert callable(RTCRtpSender._send_keyframe)


def test_a_part_that_is_gone_is_named(monkeypatch):
    monkeypatch.setattr(
        compatibility_check,
        "REPLACED",
        (*compatibility_check.REPLACED, "_RTCRtpReceiver__crystal_ball"),
    )
    with pytest.raises(compatibility_check.AiortcMismatchError, match="crystal_ball") as refused:
        with_connection(
            lambda t: ReceiverAdapter(t.receiver, lambda *_: True, lambda _: None, lambda: None)
        )
    assert "Install the locked version" in str(refused.value)


def test_a_method_that_takes_something_else_is_named(monkeypatch):
    def add(self, packet, arrival):
        return False

    monkeypatch.setattr(compatibility_check, "CALLED", {add: ["self", "packet"]})
    wrong = with_connection(lambda transceiver: compatibility_check.misfits(transceiver.receiver))
    assert wrong == [
        f"{add.__qualname__} takes ['self', 'packet', 'arrival'], not ['self', 'packet']"
    ]
