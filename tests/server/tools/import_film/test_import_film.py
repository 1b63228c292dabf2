"""`lightleash import`: what comes out is what was filmed and felt, and every tool takes it."""

from fractions import Fraction

import av
import numpy as np
import pytest

from hardware.camera_file import CAMERAS
from pipeline.signals import PhoneImu
from server.cli import main
from server.export.decoded import DatedPicture, DecodedRecording
from server.export.recorded_film import imu_samples, open_film
from server.media.frame_source import open_frames
from server.protocol.wire_records import Codec
from server.recording.reader import read
from server.replay.offline import Offline
from tests.server.export.recordings import CHROMIUM, FLIGHT, SIZE, film, spot, spot_at
from tests.server.tools.locate.locating import table

CAMERA = str(CAMERAS / "virtual_phone.yaml")
HEADER = "t_s,gx,gy,gz,ax,ay,az\n"
TICKS_HZ = 90_000


def write_imu(path, rows):
    text = "".join(",".join(f"{cell:.7f}" for cell in row) + "\n" for row in rows)
    path.write_text(HEADER + text)
    return path


def as_anybodys(source, folder):
    """The virtual phone's flight as another app would have kept it: film.mp4 and imu.csv."""
    items = list(DecodedRecording(read(source)).items())
    pictures = [item for item in items if isinstance(item, DatedPicture)]
    first = pictures[0].t
    with av.open(str(folder / "film.mp4"), "w") as container:
        stream = container.add_stream("h264", rate=20)
        stream.width, stream.height = pictures[0].picture.width, pictures[0].picture.height
        stream.time_base = Fraction(1, TICKS_HZ)
        for item in pictures:
            packet = av.Packet(item.picture.data)
            packet.stream, packet.time_base = stream, stream.time_base
            packet.pts = packet.dts = round((item.t - first) * TICKS_HZ)
            packet.is_keyframe = item.picture.key
            container.mux(packet)
    samples = imu_samples(source)[0]
    write_imu(folder / "imu.csv", samples)
    return first, pictures, samples


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("anybody")
    first, pictures, imu = as_anybodys(FLIGHT, folder)
    words = ["import", str(folder / "film.mp4"), "--imu", str(folder / "imu.csv")]
    words += ["--offset", f"{first:.9f}", "--out", str(folder / "flight.mcap")]
    words += ["--camera", CAMERA, "--screen-angle", "90"]
    assert main(words) == 0
    return folder, pictures, imu


def test_pictures_and_motion_come_back_at_their_times(imported):
    folder, pictures, imu = imported
    recording = read(folder / "flight.mcap")
    items = list(DecodedRecording(recording).items())
    again = [item for item in items if isinstance(item, DatedPicture)]
    assert [item.picture.data for item in again] == [item.picture.data for item in pictures]
    assert [item.picture.key for item in again] == [item.picture.key for item in pictures]
    shifts = np.array([b.t - a.t for a, b in zip(pictures, again, strict=True)])
    assert np.ptp(shifts) < 3e-5  # the film counts ticks of 11 µs
    samples = np.array(
        [(s.t, *s.omega_m_cf_in_c, *s.a_m_cf_in_c) for s in items if isinstance(s, PhoneImu)]
    )
    np.testing.assert_allclose(samples[:, 1:], imu[:, 1:], atol=2e-6)
    np.testing.assert_allclose(samples[:, 0] - imu[:, 0], shifts.mean(), atol=3e-5)


@pytest.mark.slow
def test_replay_finds_the_robot_in_it(imported):
    folder, pictures, _ = imported
    rows = list(Offline(read(folder / "flight.mcap")).rows())
    assert len(rows) == len(pictures)
    assert np.mean([row["found"] == "1" for row in rows]) > 0.95
    last = [float(rows[-1][f"{axis}_m"]) for axis in "xyz"]
    then = list(Offline(read(FLIGHT)).rows())[-1]
    assert last == pytest.approx([float(then[f"{axis}_m"]) for axis in "xyz"], abs=0.01)


@pytest.mark.slow
def test_locate_says_of_the_recording_what_it_says_of_the_film(imported, tmp_path):
    folder, pictures, imu = imported
    camera = ["--camera", CAMERA, "--robot", "ames", "--no-plot"]
    flight = str(folder / "flight.mcap")
    assert main(["locate", flight, *camera, "--out", str(tmp_path / "a.csv")]) == 0
    early = write_imu(tmp_path / "imu.csv", imu - pictures[0].t * np.eye(7)[0])
    film = [str(folder / "film.mp4"), "--imu", str(early)]
    assert main(["locate", *film, *camera, "--out", str(tmp_path / "b.csv")]) == 0
    a, b = (table(tmp_path / name) for name in ("a.csv", "b.csv"))
    assert len(a) == len(b) == len(pictures)
    found = [(one, other) for one, other in zip(a, b, strict=True) if one["found"] == "1"]
    assert len(found) > 0.95 * len(a)
    for axis in "xyz":
        differences = [float(p[f"{axis}_m"]) - float(q[f"{axis}_m"]) for p, q in found if q["x_m"]]
        assert np.median(np.abs(differences)) < 5e-4


@pytest.mark.slow
def test_calibrate_reads_the_recording_as_it_reads_the_film(imported, capsys):
    """There is no board in it: what was read is told before that."""
    folder, pictures, _ = imported
    film = list(open_frames(folder / "film.mp4"))
    recorded = open_film(folder / "flight.mcap")
    assert recorded.count == len(film) == len(pictures)
    for one, other in zip(recorded, film, strict=True):
        assert (one.luma == other.luma).all()
        assert one.full_range == other.full_range
    assert main(["calibrate", str(folder / "flight.mcap")]) == 1
    assert "refused" in capsys.readouterr().out


def write_film(path, codec, options, pictures=12):
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=30, options=options)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        container.metadata["creation_time"] = "2026-05-04T10:11:12.000000Z"
        for k in range(pictures):
            frame = av.VideoFrame.from_ndarray(np.repeat(spot(k)[..., None], 3, 2), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize(
    ("codec", "options"), [("libx264", {"bf": "2"}), ("mpeg4", {})], ids=["B-frames", "mpeg4"]
)
def test_what_no_page_would_send_is_encoded_anew(tmp_path, capsys, codec, options):
    film = write_film(tmp_path / "film.mp4", codec, options)
    out = tmp_path / "film.mcap"
    assert main(["import", str(film), "--out", str(out)]) == 0
    assert "encoded anew" in capsys.readouterr().out
    shots = [(shot.t, spot_at(shot.luma)) for shot in open_film(out)]
    times, places = np.array(shots).T
    assert np.diff(times) == pytest.approx(1.0 / 30.0, abs=1e-4)
    assert places == pytest.approx([40.0 + 10.0 * k for k in range(12)], abs=0.5)


def test_the_day_is_the_films_own_or_that_of_a_clock_since_1970(tmp_path):
    film = write_film(tmp_path / "film.mp4", "mpeg4", {})
    assert main(["import", str(film), "--out", str(tmp_path / "a.mcap")]) == 0
    decoded = DecodedRecording(read(tmp_path / "a.mcap"))
    first = next(item for item in decoded.items() if isinstance(item, DatedPicture))
    assert decoded.utc(first.t)[:21] in ("2026-05-04T10:11:11.9", "2026-05-04T10:11:12.0")
    at = 1_800_000_000.0
    imu = write_imu(tmp_path / "imu.csv", [(at + 0.01 * k, 0, 0, 0, 0, 0, 9.8) for k in range(50)])
    words = ["import", str(film), "--imu", str(imu), "--offset", str(at)]
    assert main([*words, "--out", str(tmp_path / "b.mcap")]) == 0
    decoded = DecodedRecording(read(tmp_path / "b.mcap"))
    first = next(item for item in decoded.items() if isinstance(item, DatedPicture))
    assert decoded.unix_ns(first.t) == pytest.approx(1e9 * at, abs=1e5)


@pytest.mark.parametrize("angle", [0, 90, 180, 270])
def test_motion_keeps_its_axes_at_each_angle_of_the_screen(tmp_path, angle):
    film = write_film(tmp_path / "film.mp4", "mpeg4", {})
    rows = [(0.01 * k, 0.1, 0.2, 0.3, 1.0, 2.0, 9.5) for k in range(60)]
    imu = write_imu(tmp_path / "imu.csv", rows)
    words = ["import", str(film), "--imu", str(imu), "--screen-angle", str(angle)]
    assert main([*words, "--out", str(tmp_path / "a.mcap")]) == 0
    samples, body = imu_samples(tmp_path / "a.mcap")
    assert body is None
    assert len(samples) == 60
    np.testing.assert_allclose(samples[:, 1:], np.array(rows)[:, 1:], atol=1e-6)


def test_pictures_of_the_film_are_marked_as_h264_of_its_size(tmp_path):
    film = write_film(tmp_path / "film.mp4", "libx264", {"tune": "zerolatency"}, pictures=3)
    assert main(["import", str(film), "--out", str(tmp_path / "a.mcap")]) == 0
    items = DecodedRecording(read(tmp_path / "a.mcap")).items()
    pictures = [item.picture for item in items if isinstance(item, DatedPicture)]
    assert [(p.codec, p.width, p.height) for p in pictures] == 3 * [(Codec.H264, *SIZE)]
    assert pictures[0].data[:3] in (b"\0\0\0", b"\0\0\1")  # Annex B


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--imu", "{late}"], "--offset"),
        (["--imu", "{none}"], "No such file"),
        (["--robot", "nobody"], "no such robot"),
        (["--camera", "{none}"], "No such file"),
    ],
)
def test_what_does_not_go_together_is_named_and_nothing_is_written(tmp_path, capsys, more, said):
    film = write_film(tmp_path / "film.mp4", "mpeg4", {}, pictures=3)
    late = write_imu(tmp_path / "late.csv", [(99.0 + k, 0, 0, 0, 0, 0, 9.8) for k in range(9)])
    words = [word.format(late=late, none=tmp_path / "none") for word in more]
    assert main(["import", str(film), "--out", str(tmp_path / "a.mcap"), *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "a.mcap").exists()


def test_a_recording_is_not_written_over(tmp_path, capsys):
    film = write_film(tmp_path / "film.mp4", "mpeg4", {}, pictures=3)
    (tmp_path / "a.mcap").write_bytes(b"mine")
    assert main(["import", str(film), "--out", str(tmp_path / "a.mcap")]) == 2
    assert (tmp_path / "a.mcap").read_bytes() == b"mine"


def test_a_real_browsers_recording_is_a_film_too():
    film = open_film(CHROMIUM)
    shots = list(film)
    assert film.count == len(shots) == 210
    assert [shot.problem for shot in shots if shot.luma is None] == [
        "It leans on a picture that is not in the recording."
    ]
    phone, body = imu_samples(CHROMIUM)
    assert len(body) == 1424
    assert np.all(np.diff(phone[:, 0]) > 0.0)


def test_a_damaged_recording_is_named(tmp_path, capsys):
    path = tmp_path / "cut.mcap"
    path.write_bytes(FLIGHT.read_bytes()[:100_000])
    words = ["--camera", CAMERA, "--robot", "ames", "--out", "x.csv"]
    assert main(["locate", str(path), *words]) == 2
    assert "never closed" in capsys.readouterr().err


@pytest.mark.parametrize("tool", ["locate", "calibrate"])
def test_a_recording_without_a_picture_is_named_and_nothing_is_written(tool, tmp_path, capsys):
    """Of a phone whose camera was refused, its motion and its button alone are there."""
    flight = film(tmp_path, "jpeg", pictures=0, touches=[(100.0, False, 0), (100.1, True, 1)])
    more = ["--camera", CAMERA, "--robot", "ames", "--no-plot"] if tool == "locate" else []
    assert main([tool, str(flight), *more, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1] == f"lightleash {tool}: {flight}: holds no picture; name another recording"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("robot", ["rover", "quadrotor"])
def test_a_film_of_any_robot_is_taken(robot, tmp_path):
    film = write_film(tmp_path / "film.mp4", "mpeg4", {}, pictures=3)
    words = ["import", str(film), "--out", str(tmp_path / "a.mcap"), "--robot", robot]
    assert main(words) == 0
    assert DecodedRecording(read(tmp_path / "a.mcap")).robot.robot.name == robot
