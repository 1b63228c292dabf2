"""The protocol page and the client's types are what the code says, or this is red."""

from __future__ import annotations

import re
from dataclasses import fields

import pytest

from server.docs import generate, protocol_text
from server.protocol import wire
from server.protocol.messages import Hello, Status
from server.protocol.wire import Kind
from server.protocol.wire_records import Codec

ROOT = generate.ROOT


def test_generated_files_are_in_step(capsys):
    assert generate.main(["--check"]) == 0, capsys.readouterr().out


def test_out_of_step_is_told_and_written_anew(tmp_path, monkeypatch, capsys):
    path = tmp_path / "page.md"
    monkeypatch.setattr(generate, "ROOT", tmp_path)
    monkeypatch.setattr(generate, "outputs", lambda: {path: "new"})
    assert generate.main(["--check"]) == 1
    assert not path.exists()
    assert generate.main([]) == 0
    assert path.read_text() == "new"
    assert generate.main(["--check"]) == 0
    assert "page.md: out of step" in capsys.readouterr().out


def test_the_clients_own_constants_are_the_servers():
    text = (ROOT / "web_client/src/wire/protocol.js").read_text(encoding="utf-8")

    def table(name):
        inside = re.search(rf"const {name} = Object.freeze\(\{{(.*?)\}}\)", text, re.S)
        return {key: int(value) for key, value in re.findall(r"(\w+): (\d+)", inside.group(1))}

    def number(name):
        found = re.search(rf"const {name} = ([\w]+);", text).group(1)
        return int(found.replace("_", ""), 0)

    assert table("Kind") == {kind.name: int(kind) for kind in Kind}
    assert table("Codec") == {codec.name: int(codec) for codec in Codec}
    assert number("VERSION") == wire.VERSION
    assert number("MAGIC") == wire.MAGIC
    assert number("MAX_RECORD_BYTES") == wire.MAX_RECORD_BYTES
    assert number("HEADER_BYTES") == wire.HEADER.size
    assert number("FRAME_HEAD_BYTES") == wire.FRAME.size


@pytest.mark.parametrize("kind", Kind)
def test_every_field_of_every_record_is_on_the_page(kind):
    body, layout, names = protocol_text.RECORDS[kind]
    told = {name for name, _ in names if name} | {"data", "key", "by_arrival"}
    assert {field.name for field in fields(body)} <= told | {"orientation_wxyz"}
    page = (ROOT / "PROTOCOL.md").read_text(encoding="utf-8")
    assert f"### {kind.name} ({int(kind)})" in page
    assert layout is None or layout.format.startswith("<")


def test_a_layout_that_lost_a_field_is_noticed():
    with pytest.raises(ValueError, match="Qq"):
        list(generate.byte_rows(wire.PONG, [("nonce", 1, "")], 16))


def test_offsets_add_up_to_the_size():
    rows = list(generate.byte_rows(wire.HEADER, generate.HEADER_FIELDS, 0))
    assert rows[-1].startswith("| 8 | i64 | time |")
    _, layout, names = protocol_text.RECORDS[Kind.MOTION]
    rows = list(generate.byte_rows(layout, [(n, c, "") for n, c in names], 16))
    assert rows[-1].startswith(f"| {16 + wire.MOTION.size - 2} | u16 |")


def test_every_code_of_a_refusal_is_explained_and_none_is_left_over():
    used = set()
    for path in (ROOT / "server").rglob("*.py"):
        used |= set(re.findall(r'WireError\(\s*"(\w+)"', path.read_text(encoding="utf-8")))
    assert used == set(protocol_text.CODES)


def test_limits_are_those_of_the_decoder():
    limits = generate.limits()
    assert limits["motion.rotation_rate"] == "finite, within ±70 rad/s"
    assert limits["frame.width"] == limits["frame.height"]
    assert "touch.visible" in limits


def test_types_are_what_json_holds():
    hints = {name: generate.js_type(hint) for name, hint, _ in generate._fields(Status)}
    assert hints["ready"] == "boolean"
    assert hints["error_mm"] == "number | null"
    assert hints["position_mm"] == "number[] | null"
    assert hints["streams"] == "Record<string, Stream>"
    hello = {name: generate.js_type(hint) for name, hint, _ in generate._fields(Hello)}
    assert hello["role"] == "'operator' | 'supervisor' | 'video' | 'screen'"
    assert hello["device"] == "string"
