"""Files of the pages on the wire: light, and sent once."""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from server.web.page_files import CLIENT, modules_of
from tests.server.house import house_in

LINK = re.compile(r'(?:href|src)="([\w/.-]+\.(?:css|js|svg))"')
MOST_BYTES = 100_000


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    with (
        house_in(tmp_path) as house,
        TestClient(house.app, base_url="http://127.0.0.1:8080") as asks,
    ):
        yield asks


def files_of(page: str, client: TestClient) -> list[str]:
    """What a browser asks for on its first visit."""
    return [page, *dict.fromkeys(f"/{name}" for name in LINK.findall(client.get(page).text))]


@pytest.mark.parametrize(
    ("page", "script"),
    [("/", "app"), ("/supervisor", "dashboard"), ("/screen", "screen"), ("/check", "check")],
)
def test_a_page_weighs_less_than_100_kb_and_its_second_visit_nothing(
    client: TestClient, page: str, script: str
) -> None:
    names = files_of(page, client)
    first = [client.get(name, headers={"accept-encoding": "gzip"}) for name in names]
    assert {answer.headers["content-encoding"] for answer in first} == {"gzip"}
    assert sum(int(answer.headers["content-length"]) for answer in first) < MOST_BYTES
    needed = modules_of(CLIENT / "src" / script / "main.js")
    assert {f"/{path.relative_to(CLIENT)}" for path in needed} <= set(names)
    again = [
        client.get(name, headers={"if-none-match": answer.headers["etag"]})
        for name, answer in zip(names, first, strict=True)
    ]
    assert {(answer.status_code, answer.content) for answer in again} == {(304, b"")}


def test_who_takes_no_gzip_gets_the_file_and_another_one_is_sent_anew(client: TestClient) -> None:
    plain = client.get("/style.css", headers={"accept-encoding": "identity"})
    assert plain.content == (CLIENT / "style.css").read_bytes()
    assert "content-encoding" not in plain.headers
    assert plain.headers["cache-control"] == "no-cache"
    assert plain.headers["vary"] == "accept-encoding"
    old = client.get("/style.css", headers={"if-none-match": '"another"'})
    assert old.status_code == 200


def test_what_is_sent_is_the_file(client: TestClient) -> None:
    with client.stream("GET", "/src/app/main.js", headers={"accept-encoding": "gzip"}) as answer:
        raw = b"".join(answer.iter_raw())
    assert gzip.decompress(raw) == (CLIENT / "src" / "app" / "main.js").read_bytes()
    assert client.post("/src/app/main.js").status_code in (401, 403, 405)
