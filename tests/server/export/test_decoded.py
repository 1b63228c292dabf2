"""Times of what was recorded: those of the truth, as well known as they say."""

import numpy as np
import pytest

from hardware.codec import Encoder
from server.export.decoded import DatedPicture, DecodedRecording
from server.protocol.wire import encode
from server.protocol.wire_records import Codec, Picture, Ping, Pong, Record
from server.recording.reader import read
from server.recording.writer import write_whole
from tests.server.export.recordings import SIZE, spot

AHEAD_S, FASTER = 777.7, 80e-6
"""The phone's clock, beside the server's."""


def filmed(path, seed):
    """Pictures with their true times, over a link whose ways there and back take 5 to 90 ms."""
    rng = np.random.default_rng(seed)
    phone_us = lambda t: round(1e6 * ((1.0 + FASTER) * t + AHEAD_S))  # noqa: E731
    items, truth = [], 100.0 + np.cumsum(rng.uniform(0.02, 0.08, 150))
    for k, t in enumerate(np.arange(100.0, truth[-1], 1.0 / 20.0)):
        there, back = rng.uniform(0.005, 0.09, 2)
        items.append(("server/records", t, encode(Record(k, round(1e6 * t), Ping(k + 1)))))
        pong = Record(k, phone_us(t + there), Pong(k + 1, round(1e6 * t)))
        items.append(("phone/records", t + there + back, encode(pong)))
    data, _ = Encoder(*SIZE, 30.0, 1_000_000, "jpeg").encode(spot(0))
    picture = Picture(Codec.JPEG, True, *SIZE, 0, data)
    for k, t in enumerate(truth):
        arrived = t + rng.uniform(0.03, 0.2)
        items.append(("phone/records", arrived, encode(Record(k, phone_us(t), picture))))
    write_whole(path, {"device": "nobody's"}, sorted(items, key=lambda item: item[1]))
    return truth


@pytest.mark.parametrize("seed", [1000, 1001, 1002])
def test_captures_are_known_to_5_ms_whatever_the_link(tmp_path, seed):
    truth = filmed(tmp_path / "film.mcap", seed)
    items = DecodedRecording(read(tmp_path / "film.mcap")).items()
    shown = {item.sequence: item for item in items if isinstance(item, DatedPicture)}
    errors = np.array([shown[k].t - t for k, t in enumerate(truth)])
    settled = truth > 103.0
    assert len(errors) == 150
    assert np.abs(errors[settled]).max() < 5e-3
    sigmas = np.array([shown[k].sigma_s for k in range(150)])
    assert np.all(np.abs(errors) < 3.0 * sigmas)
