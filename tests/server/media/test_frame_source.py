from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from server.common.errors import InputError
from server.media.frame_source import open_frames

SIZE = (48, 64)


def picture(k):
    """Grey levels that tell which one it is."""
    image = np.full(SIZE, 10, np.uint8)
    image[:, 8 * k : 8 * k + 8] = 200
    return image


def folder(tmp_path, names=("a.png", "b.png", "c.png"), times=None):
    for k, name in enumerate(names):
        cv2.imwrite(str(tmp_path / name), picture(k))
    if times is not None:
        (tmp_path / "times.csv").write_text("frame,t_s\n" + "\n".join(times) + "\n")
    return tmp_path


def test_a_folders_frames_come_in_the_order_of_their_names_at_30_a_second(tmp_path):
    frames = open_frames(folder(tmp_path, ("b.png", "c.JPG", "a.jpeg")))
    shots = list(frames)
    assert [shot.name for shot in shots] == ["a.jpeg", "b.png", "c.JPG"]
    assert [shot.t for shot in shots] == [0.0, 1 / 30, 2 / 30]
    assert (frames.count, frames.span) == (3, (0.0, 2 / 30))
    assert "30 frames a second" in frames.notes[0]
    assert all(shot.full_range for shot in shots)


def test_another_rate_may_be_given(tmp_path):
    frames = open_frames(folder(tmp_path), 50.0)
    assert [shot.t for shot in frames] == [0.0, 0.02, 0.04]
    assert frames.notes == []


def test_times_csv_dates_the_frames_whatever_rate_is_given(tmp_path):
    frames = open_frames(folder(tmp_path, times=["a.png,5.5", "b.png,5.6", "c.png,5.75"]), 50.0)
    assert [shot.t for shot in frames] == [5.5, 5.6, 5.75]
    assert "--fps is not used" in frames.notes[0]


TIMES = [
    (["a.png,0", "b.png,1", "d.png,2"], "line 4", "no frame 'd.png' in the folder"),
    (["a.png,0", "b.png,1"], "", "1 frames have no time, first 'c.png'"),
    (["a.png,0", "c.png,1", "b.png,2"], "line 3", "order of names must be that of time"),
    (["a.png,0", "b.png,0", "c.png,1"], "line 3", "times must ascend"),
]


@pytest.mark.parametrize(("times", "where", "allowed"), TIMES)
def test_times_that_do_not_fit_the_frames_are_refused(tmp_path, times, where, allowed):
    with pytest.raises(InputError) as raised:
        open_frames(folder(tmp_path, times=times))
    assert (raised.value.file, raised.value.where) == (str(tmp_path / "times.csv"), where)
    assert allowed in raised.value.allowed


def test_colour_and_transparency_and_16_bits_are_grey_levels(tmp_path):
    grey = picture(1)
    cv2.imwrite(str(tmp_path / "a.png"), cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    cv2.imwrite(str(tmp_path / "b.png"), cv2.cvtColor(grey, cv2.COLOR_GRAY2BGRA))
    cv2.imwrite(str(tmp_path / "c.png"), grey.astype(np.uint16) * 257)
    frames = open_frames(tmp_path, 30.0)
    for shot in frames:
        np.testing.assert_array_equal(shot.luma, grey)
    assert frames.notes == []


def test_16_bit_frames_of_a_12_bit_sensor_are_told_of(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), picture(1).astype(np.uint16) * 16)
    frames = open_frames(tmp_path, 30.0)
    assert len(list(frames)) == 1
    assert "never exceed 3200" in frames.notes[0]


@pytest.mark.parametrize("data", [b"", b"not a picture", b"\x89PNG\r\n\x1a\n" + bytes(40)])
def test_an_unreadable_frame_is_there_without_a_picture(tmp_path, data):
    folder(tmp_path)
    (tmp_path / "b.png").write_bytes(data)
    shots = list(open_frames(tmp_path))
    assert [shot.luma is None for shot in shots] == [False, True, False]
    assert [shot.problem for shot in shots][1] == "The file can't be read as a picture."


def test_a_folder_without_frames_is_refused_and_so_is_nothing(tmp_path):
    (tmp_path / "._a.png").write_bytes(b"what another system leaves")
    with pytest.raises(InputError, match=r"holds no frames \(\.png, \.jpg, \.jpeg\)"):
        open_frames(tmp_path)
    with pytest.raises(InputError, match="no such folder or film"):
        open_frames(tmp_path / "missing")


def film(path, codec="libx264", pix_fmt="yuv420p", full=False, options=None, pictures=None):
    """A film whose frames are 40 ms apart, the third 10 ms late, beginning at 0.2 s."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25)
        stream.height, stream.width = pictures[0].shape if pictures else SIZE
        stream.pix_fmt, stream.time_base = pix_fmt, Fraction(1, 1000)
        stream.codec_context.time_base = Fraction(1, 1000)
        stream.options = options or {}
        stream.codec_context.color_range = 2 if full else 1
        for k, image in enumerate(pictures or [picture(k) for k in range(4)]):
            shot = av.VideoFrame.from_ndarray(image, format="gray")
            frame = shot.reformat(format=pix_fmt, dst_color_range=2 if full else 1)
            frame.pts, frame.time_base = 200 + 40 * k + 10 * (k == 2), Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


LOSSLESS = {"qp": "0", "preset": "ultrafast"}


def test_a_films_frames_have_its_own_times_and_numbers_for_names(tmp_path):
    frames = open_frames(film(tmp_path / "a.mkv", options=LOSSLESS))
    shots = [(shot.name, shot.t) for shot in frames]
    times = [0.2, 0.24, 0.29, 0.32]
    assert [name for name, _ in shots] == [f"{k:06d}" for k in range(4)]
    np.testing.assert_allclose([t for _, t in shots], times, atol=1e-6)


def test_a_given_rate_replaces_a_films_times(tmp_path):
    frames = open_frames(film(tmp_path / "a.mkv"), 10.0)
    np.testing.assert_allclose([shot.t for shot in frames], [0.0, 0.1, 0.2, 0.3])


FORMATS = [
    ("libx264", "yuv420p", False),
    ("libx264", "yuv420p", True),
    ("libx264", "yuv420p10le", False),
    ("libx264", "yuv444p", False),
    ("ffv1", "gray", True),
    ("ffv1", "bgr0", True),
]


@pytest.mark.parametrize(("codec", "pix_fmt", "full"), FORMATS)
def test_a_films_grey_levels_and_their_range_are_known(tmp_path, codec, pix_fmt, full):
    options = LOSSLESS if codec == "libx264" else {}
    path = film(tmp_path / "a.mkv", codec, pix_fmt, full=full, options=options)
    for k, shot in enumerate(open_frames(path)):
        assert shot.full_range == full
        grey = picture(k).astype(float)
        expected = grey if full else 16.0 + 219.0 / 255.0 * grey
        assert np.abs(shot.luma - expected).max() <= 3.0


def test_what_is_no_film_is_refused(tmp_path):
    path = tmp_path / "a.mp4"
    path.write_bytes(b"words" * 100)
    with pytest.raises(InputError, match="neither a folder nor a film"):
        open_frames(path)


def damaged(path, size, preset, b_frames):
    """A film of noise whose third packet is not what it was."""
    rng = np.random.default_rng(4)
    noise = [rng.integers(0, 255, size).astype(np.uint8) for _ in range(8)]
    options = {"preset": preset, "x264-params": f"keyint=6:scenecut=0:bframes={b_frames}"}
    film(path, options=options, pictures=noise)
    with av.open(str(path)) as container:
        third = bytes([p for p in container.demux() if p.size][2])
    changed = third[:200] + bytes(byte ^ 0x5A for byte in third[200:])
    path.write_bytes(path.read_bytes().replace(third, changed))
    return path


@pytest.mark.parametrize(("size", "preset"), [((240, 320), "medium"), (SIZE, "ultrafast")])
def test_of_a_damaged_film_nothing_is_believed_until_the_next_key_frame(tmp_path, size, preset):
    """Whether FFmpeg refuses the packet or paints it over."""
    path = damaged(tmp_path / "a.mkv", size, preset, 0)
    shots = list(open_frames(path))
    assert [shot.luma is not None for shot in shots] == [True] * 2 + [False] * 4 + [True] * 2
    assert [round(1e3 * shot.t) for shot in shots] == [200, 240, 290, 320, 360, 400, 440, 480]
    assert shots[3].problem.startswith("Damaged")


def test_where_frames_are_reordered_lost_ones_are_counted_and_nothing_after_them_is_believed(
    tmp_path,
):
    frames = open_frames(damaged(tmp_path / "a.mkv", (240, 320), "medium", 2))
    shots = [(round(1e3 * shot.t), shot.luma is not None) for shot in frames]
    lost = {200, 240, 290, 320, 360, 400, 440, 480} - {t for t, _ in shots}
    assert len(lost) == 1
    assert [t for t, _ in shots] == sorted(t for t, _ in shots)
    assert all(is_whole == (t >= 440) for t, is_whole in shots)
    assert frames.notes == ["1 packets can't be decoded: their frames have no row"]


def test_one_picture_is_no_film(tmp_path):
    with pytest.raises(InputError, match="name the folder of all"):
        open_frames(folder(tmp_path) / "a.png")
