"""Doctor's look at the operator's link, over the real server."""

from __future__ import annotations

import asyncio
import socket
import threading

import pytest

from server.common.access import Access, PhoneClientError
from server.diagnostics.link_check import LEAST_S
from server.protocol.wire_records import Motion
from server.tools import doctor
from server.tools.doctor_phone import ask, examine
from tests.server.house import HOST, eventually, house_in

FLAT = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), None, 0)


@pytest.fixture
def server(tmp_path):
    with house_in(tmp_path) as house:
        yield house


def access(server):
    return Access(f"http://{HOST}:{server.port}", server.doors.operator_token)


@pytest.mark.slow
def test_the_link_of_the_phone_that_leads_is_told_and_without_one_that_is_said(server):
    async def scene():
        async with server.open():
            with pytest.raises(PhoneClientError, match="while a phone leads"):
                await asyncio.to_thread(ask, access(server), 1.0)
            async with server.operator() as page:
                await page.synchronise()
                await eventually(lambda: server.manager.phone.ingest.clock.ready)
                for k in range(3):
                    await page.send(FLAT, sequence=k + 1)
                    await page.answer()
                await eventually(lambda: len(server.manager.phone.link._kinds["answers"]) >= 9)
                report = await asyncio.to_thread(ask, access(server), 60.0)
                assert report.grade == "unknown"  # so short a look promises nothing
                assert report.motion_hz > 0.0
                assert report.rtt_ms is not None
                with pytest.raises(PhoneClientError, match="seconds"):
                    await asyncio.to_thread(ask, access(server), 61.0)

    asyncio.run(scene())


@pytest.mark.slow
def test_no_proxy_of_the_environment_comes_between_nor_learns_the_key(server, monkeypatch):
    for name in ("no_proxy", "NO_PROXY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("http_proxy", f"http://{HOST}:9")

    async def scene():
        async with server.open():
            with pytest.raises(PhoneClientError, match="while a phone leads"):
                await asyncio.to_thread(ask, access(server), 1.0)

    asyncio.run(scene())


@pytest.mark.slow
def test_a_verdict_is_printed_with_what_to_do_and_poor_or_unknown_fails(server):
    told = []

    async def scene():
        async with server.open(), server.operator() as page:
            await page.synchronise()
            assert await asyncio.to_thread(examine, access(server), 0.1, told.append) == 1

    asyncio.run(scene())
    assert "for 0.1 s" in told[0]
    assert told[1].startswith("Not enough was heard")
    assert "→ Open the page on the phone" in told[1]


@pytest.mark.parametrize("seconds", [0.5 * LEAST_S, 61.0])
def test_a_look_that_says_nothing_or_that_nobody_remembers_is_refused(seconds, capsys):
    with pytest.raises(SystemExit):
        doctor.main(["--phone", "--seconds", str(seconds)])
    assert "allowed with --phone: 5 to 60" in capsys.readouterr().err


def test_without_a_server_doctor_says_so(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert doctor.main(["--phone"]) == 1
    assert "no server is running here" in capsys.readouterr().err


def test_a_certificate_that_is_not_there_is_told_in_a_line(capsys):
    words = ["--token", "t", "--url", "https://127.0.0.1:1", "--ca", "nowhere.pem"]
    assert doctor.main(["--phone", *words]) == 1
    assert capsys.readouterr().err == "lightleash doctor: --ca nowhere.pem: no such file\n"


def test_a_server_of_another_kind_is_told_in_a_line(capsys):
    with socket.create_server((HOST, 0)) as other:

        def answer():
            here, _ = other.accept()
            with here:
                here.recv(1)
                here.sendall(b"SSH-2.0-something\r\n")

        threading.Thread(target=answer, daemon=True).start()
        url = f"http://{HOST}:{other.getsockname()[1]}"
        assert doctor.main(["--phone", "--token", "t", "--url", url]) == 1
    told = capsys.readouterr().err
    assert told.startswith(f"lightleash doctor: {url}: ")
    assert told.count("\n") == 1
