import numpy as np
import pytest

from server.common.errors import InputError
from server.media.tables import load_imu, load_times

IMU = "t_s,gx,gy,gz,ax,ay,az"
REST = "0,0,0,0.1,0.2,9.8"


def written(tmp_path, *lines, end="\n"):
    path = tmp_path / "table.csv"
    path.write_text(end.join(lines) + end, encoding="utf-8", newline="")
    return path


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_motion_samples_are_read(tmp_path, end):
    path = written(tmp_path, IMU, f"0.5,{REST}", "", "0.51, 1e-3,-2,0,0,0,9.7", end=end)
    expected = [[0.5, 0, 0, 0, 0.1, 0.2, 9.8], [0.51, 1e-3, -2, 0, 0, 0, 9.7]]
    np.testing.assert_array_equal(load_imu(path), expected)


def test_a_byte_order_mark_and_seconds_since_1970_do_not_matter(tmp_path):
    path = written(tmp_path, f"\ufeff{IMU}", f"1763726000.25,{REST}", f"1763726000.26,{REST}")
    assert load_imu(path)[0, 0] == 1763726000.25


def test_times_are_read_with_their_lines(tmp_path):
    path = written(tmp_path, "frame,t_s", "a.png,0.5", '"b, c.png",0.7')
    assert load_times(path) == {"a.png": (2, 0.5), "b, c.png": (3, 0.7)}


FAULTS = [
    (["t,gx,gy,gz,ax,ay,az", f"0,{REST}"], "line 1", "the header must be t_s,gx,gy"),
    ([f"0,{REST}", f"1,{REST}"], "line 1", "the header must be"),
    ([""], "line 1", "the header must be"),
    ([IMU, f"0,{REST}", "1,0,0,0,0,9.8"], "line 3", "7 cells"),
    ([IMU, f"0,{REST}", f"1,{REST},5"], "line 3", "7 cells"),
    ([IMU, f"0,{REST}", "1,0,nan,0,0,0,9.8"], "line 3", "gy must be a finite number, not 'nan'"),
    ([IMU, f"0,{REST}", "1,0,0,0,0,,9.8"], "line 3", "ay must be a finite number, not ''"),
    ([IMU, f"inf,{REST}", f"1,{REST}"], "line 2", "t_s must be a finite number"),
    ([IMU, f"0,{REST}", "", f"0,{REST}"], "line 4", "times must ascend: 0 s comes after 0 s"),
    ([IMU, f"2,{REST}", f"1,{REST}"], "line 3", "times must ascend: 1 s comes after 2 s"),
    ([IMU, f"1763726000250000,{REST}", f"1,{REST}"], "line 2", "must be in seconds"),
    ([IMU, f"0,{REST}", "1,101,0,0,0,0,9.8"], "line 3", "gx must be from -100 to 100 rad/s"),
    ([IMU, f"0,{REST}", "1,0,0,0,0,0,9800"], "line 3", "az must be from -1000 to 1000 m/s²"),
    ([IMU, "0,0,0,0,0,0,1", "1,0,0,0,0,0,1.02"], "ax,ay,az", "m/s², gravity included"),
    ([IMU, "0,0,0,0,0,0,0.1", "1,0,0,0,0,0,0"], "ax,ay,az", "are 0.05 in the median"),
    ([IMU, "0,20,0,0,0,0,9.8", "1,15,0,0,0,0,9.8"], "gx,gy,gz", "must be in rad/s"),
    ([IMU, f"0,{REST}"], "", "1 samples: at least 2"),
    ([IMU], "", "0 samples"),
    ([IMU, f'0,"0,{REST}'], "line 2", "not CSV"),
]


@pytest.mark.parametrize(("lines", "where", "allowed"), FAULTS)
def test_each_fault_names_file_line_and_what_is_allowed(tmp_path, lines, where, allowed):
    path = written(tmp_path, *lines)
    with pytest.raises(InputError) as raised:
        load_imu(path)
    assert (raised.value.file, raised.value.where) == (str(path), where)
    assert allowed in raised.value.allowed
    assert "\n" not in str(raised.value)


TIME_FAULTS = [
    (["frame,t", "a.png,0"], "line 1", "frame,t_s"),
    (["frame,t_s", "a.png,0", "a.png,1"], "line 3", "a.png is there since line 2"),
    (["frame,t_s", "a.png,1", "b.png,0"], "line 3", "times must ascend"),
    (["frame,t_s", "a.png,zero"], "line 2", "t_s must be a finite number"),
]


@pytest.mark.parametrize(("lines", "where", "allowed"), TIME_FAULTS)
def test_each_fault_of_the_times_too(tmp_path, lines, where, allowed):
    with pytest.raises(InputError) as raised:
        load_times(written(tmp_path, *lines))
    assert raised.value.where == where
    assert allowed in raised.value.allowed


def test_unreadable_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        load_imu(tmp_path / "missing.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="UTF-8"):
        load_imu(tmp_path / "binary.csv")
