"""Messages: tagged, strict, bounded."""

from __future__ import annotations

import pytest

from server.protocol.messages import Command, Hello, Refused, decode_from_server, decode_message
from server.protocol.messages import encode_message as encode
from server.protocol.wire import WireError


def test_roundtrip() -> None:
    for message in (Hello(1, "operator", "phone"), Command("arm")):
        assert decode_message(encode(message)) == message
    refused = Refused("value", "x", "1 to 2")
    assert decode_from_server(encode(refused)) == refused


@pytest.mark.parametrize(
    ("text", "code", "field"),
    [
        ("{", "type", "message"),
        ("[]", "value", "message"),
        ('{"type":"nonsense"}', "value", "$.type"),
        ('{"type":"command","what":"explode"}', "value", "$.what"),
        ('{"type":"command","what":"stop","server_ms":-1}', "value", "$.server_ms"),
        ('{"type":"command","what":"stop","server_ms":9007199254740993}', "value", "$.server_ms"),
        ('{"type":"hello","version":1,"role":"operator","x":1}', "value", "message"),
        ('{"type":"hello","version":"1","role":"operator"}', "value", "$.version"),
        ('{"type":"hello","version":NaN,"role":"operator"}', "type", "message"),
        ('{"type":"log","text":"' + "x" * 300 + '"}', "value", "$.text"),
        ('{"type":"log","text":"' + "x" * 5000 + '"}', "size", "message"),
    ],
)
def test_bad_text_is_refused_by_name(text: str, code: str, field: str) -> None:
    with pytest.raises(WireError) as refusal:
        decode_message(text)
    assert (refusal.value.code, refusal.value.field) == (code, field)
    assert refusal.value.allowed
