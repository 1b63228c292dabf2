"""Robot files: the default one is right, and each mistake is named with its place."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hardware.link.robot_end import LinkLimits
from hardware.robot_file import (
    COMMANDS,
    ROBOTS,
    BatteryParameters,
    RobotFileError,
    load_robot,
    robot_of,
    robot_path,
    robot_table,
)
from hardware.robot_physics import positive_null_vector
from hardware.robot_text import with_intervals
from pipeline import gains as sets
from pipeline.frames import GRAVITY
from tests.hardware.identified_robots import identified, intervals_of

AMES, QUADROTOR, GROUND = (load_robot(name) for name in ("ames", "quadrotor", "ground"))
TEXT = (ROBOTS / "ames.toml").read_text(encoding="utf-8")


@pytest.fixture
def changed(tmp_path):
    """Load a robot (the default one) with a part of its text replaced."""

    def load(pattern, replacement, count=1, robot="ames"):
        original = (ROBOTS / f"{robot}.toml").read_text(encoding="utf-8")
        text, n = re.subn(pattern, replacement, original, count=count)
        assert n, pattern
        path = tmp_path / "changed.toml"
        path.write_text(text, encoding="utf-8")
        return load_robot(path)

    return load


def test_the_default_robot_has_the_identified_numbers_in_si():
    plant, robot = AMES.plant, AMES.robot
    assert (plant.mass, plant.suspension.length, plant.lag, plant.delay) == (3.5, 1.3, 0.025, 0.015)
    assert plant.suspension.rest_length(plant.mass) == pytest.approx(1.3 - 3.5 * GRAVITY / 42.0)
    assert (robot.f_min, robot.f_max) == (0.2, 3.0)
    assert robot.ramp_s == pytest.approx(2.314, abs=1e-3)
    assert plant.imu.gyro_step == pytest.approx(np.deg2rad(1.0 / 16.4))
    assert plant.imu.acc_step == pytest.approx(GRAVITY / 512.0)


def test_its_allocation_matrix_is_the_balanced_octorotors():
    A = AMES.robot.A
    assert A.shape == (6, 8)
    singular = np.linalg.svd(A[:3], compute_uv=False)
    np.testing.assert_allclose(singular, np.sqrt(8.0 / 3.0), atol=1e-5)
    np.testing.assert_allclose(A @ np.ones(8), 0.0, atol=1e-5)
    for half in (np.repeat((1.0, 0.0), 4), np.repeat((0.0, 1.0), 4)):
        np.testing.assert_allclose(A @ half, 0.0, atol=1e-5)
    assert np.linalg.matrix_rank(A) == 6
    n = positive_null_vector(A)
    assert n is not None
    assert n.min() >= 1.0
    np.testing.assert_allclose(A @ n, 0.0, atol=1e-4)


def test_its_gain_sets_are_those_of_the_configuration():
    pairs = {
        "phone": sets.PHONE,
        "paper_with_ekf": sets.TABLE_II_WITH_EKF,
        "paper_without_ekf": sets.TABLE_II_WITHOUT_EKF,
    }
    assert set(AMES.gains) == set(pairs)
    for name, gains in pairs.items():
        for row in ("Kp", "Ki", "Kd"):
            np.testing.assert_array_equal(getattr(AMES.gains[name], row), getattr(gains, row))


def test_its_leds_are_on_the_cameras_side_at_arms_length_and_not_in_a_plane():
    leds = AMES.robot.leds_in_b
    assert leds.shape == (5, 3)
    distances = np.linalg.norm(leds, axis=1)
    assert ((distances >= 0.25) & (distances <= 0.35)).all()
    assert (leds[:, 0] < 0.0).all()
    assert np.linalg.svd(leds - leds.mean(axis=0), compute_uv=False)[-1] > 0.1


@pytest.mark.parametrize("robot", ["ames", "quadrotor", "copter", "ground", "twister", "rover"])
def test_every_number_says_what_it_rests_on(robot):
    text = (ROBOTS / f"{robot}.toml").read_text(encoding="utf-8")
    for line in text[: text.index("[body_imu]")].splitlines():
        if re.match(r"[a-z_0-9]+ = \[*[ \d]", line) and not line.startswith(("units", "length_m")):
            assert re.search(r"# .*(known|identified|chosen)", line), line


def test_the_links_limits_are_the_robots():
    limits = LinkLimits.of(AMES)
    assert (limits.thrusters, limits.f_max, limits.max_rise) == (8, 3.0, AMES.link.max_rise)
    assert limits.ramp_us == pytest.approx(1e6 * AMES.robot.ramp_s, abs=1.0)


MISTAKES = {
    "misspelt key": ("mass_kg", "mas_kg", "body.mas_kg", "did you mean 'mass_kg'"),
    "key without unit": ("lag_s", "lag", "thrusters.lag", "did you mean 'lag_s'"),
    "missing key": (r"stiffness_n_m = .*", "", "suspension.stiffness_n_m", "missing"),
    "unknown table": (r"\[air\]", "[wind]", "wind", "allowed here: name, axes"),
    "key of a led": (r"(leds\]\]\n)position", r"\1place", "leds.0.place", "position_in"),
    "text for a number": ("mass_kg = 3.5", 'mass_kg = "3.5"', "body.mass_kg", "number"),
    "true for a number": ("mass_kg = 3.5", "mass_kg = true", "body.mass_kg", "number"),
    "a fraction for a port": ("port = 47001", "port = 1.5", "link.port", "integer"),
    "a link without its port": ("port = 47001", "", "link.port", "of kind 'udp' has no usual"),
    "not a number": ("mass_kg = 3.5", "mass_kg = nan", "body.mass_kg", "finite"),
    "infinite": ("f_max_n = 3.0", "f_max_n = inf", "thrusters.f_max_n", "finite"),
    "negative mass": ("mass_kg = 3.5", "mass_kg = -1", "body.mass_kg", "greater than 0.05"),
    "a port too large": ("port = 47001", "port = 70000", "link.port", "65535"),
    "two coordinates": (
        r"\[\[leds\]\]\nposition_in_body_m = .*",
        "[[leds]]\nposition_in_body_m = [-0.1, 0.2]",
        "leds.0.position_in_body_m",
        "at least 3",
    ),
    "a spin of two": ("spin = 1", "spin = 2", "thrusters.units.0.spin", "1 or -1"),
    "gains of five": (r"Kp = \[[\d.]+, ", "Kp = [", "gains.phone.Kp", "at least 6"),
    "negative gains": (r"Kp = \[", "Kp = [-", "gains.phone.Kp.0", "greater"),
    "an impossible inertia": (r"0\.05, 0\.05, 0\.09", "0.05, 0.05, 0.2", "body.inertia", "sum"),
    "a cable without length": ("length_m = 1.3", "length_m = 0.5", "suspension.stiff", "above 68"),
    "f_min above f_max": ("f_min_n = 0.2", "f_min_n = 3.2", "thrusters.f_min_n", "below f_max_n"),
    "a long direction": (r"\[-0\.788675", "[-1.788675", "thrusters.units.0.direct", "length 1"),
    "centimetres": (r"\[0\.202073, 0", "[20.2073, 0", "thrusters.units.0.pos", "within 3 m"),
    "an axis that is none": ("axes = .*", 'axes = ["x", "w"]', "axes.1", "'yaw', not 'w'"),
    "an axis twice": ("axes = .*", 'axes = ["x", "x"]', "axes", "each word once"),
    "no axis": ("axes = .*", "axes = []", "axes", "at least 1"),
    "a ramp beside its suspension": ("name =", "ramp_s = 1.0\nname =", "ramp_s", "whose period"),
    "it hangs and stands": (
        r"\[air\]",
        "[stand]\nfeet_in_body_m = [[0, 1, -1], [1, 0, -1], [-1, -1, -1]]\nfriction = 1.0\n[air]",
        "stand",
        "hangs or stands",
    ),
    "neither": (r"(?ms)^\[suspension\].*?\[air\]", "[air]", "stand", "or [suspension]"),
    "too few thrusters": (r"(?m)(^    \{.*\n){2}\]", "]", "thrusters.units", "at least 7"),
    "an empty battery above a low one": (
        r"\[air\]",
        "[battery]\nlow_v = 10.0\nempty_v = 10.0\n[air]",
        "battery.empty_v",
        "less than low_v, 10 V",
    ),
    "a battery without end": (
        r"\[air\]",
        "[battery]\nlow_v = inf\nempty_v = 10.0\n[air]",
        "battery.low_v",
        "finite",
    ),
    "half a battery": (r"\[air\]", "[battery]\nlow_v = 10.5\n[air]", "battery.empty_v", "missing"),
    **{
        what: (r"\[air\]", f"[identified.{said}\n[air]", f"identified.{key}", allowed)
        for what, (said, key, allowed) in {
            "an endless interval": (
                "body]\nmass_kg = { found = 3.5, half_95 = inf }",
                "body.mass_kg.half_95",
                "finite",
            ),
            "an interval that is none": (
                "thrusters]\nlag_s = { found = 0.025, half_95 = nan }",
                "thrusters.lag_s.half_95",
                "finite",
            ),
            "an interval below 0": (
                "thrusters]\ndelay_s = { found = 0.015, half_95 = -0.001 }",
                "thrusters.delay_s.half_95",
                "greater than or equal to 0",
            ),
            "an interval with a mass of 0 in it": (
                "body]\nmass_kg = { found = 3.5, half_95 = 3.5 }",
                "body.mass_kg",
                "half_95 below found, 3.5",
            ),
            "an interval of nobody knows what": (
                "body]\nmass_kg = { half_95 = 0.1 }",
                "body.mass_kg.found",
                "missing",
            ),
            "a misspelt interval": (
                "body]\nmass_kg = { found = 3.5, half95 = 0.1 }",
                "body.mass_kg.half95",
                "did you mean 'half_95'",
            ),
            "an interval of a number that is none": (
                "body]\nmas_kg = { found = 3.5, half_95 = 0.1 }",
                "body.mas_kg",
                "did you mean 'mass_kg'",
            ),
            "an interval of no section": (
                "bodi]\nmass_kg = { found = 3.5, half_95 = 0.1 }",
                "bodi",
                "did you mean 'body'",
            ),
            "text for an interval": (
                'body]\nmass_kg = { found = 3.5, half_95 = "0.1" }',
                "body.mass_kg.half_95",
                "number",
            ),
        }.items()
    },
    "not TOML": (r"\[body\]", "[body", "", "Expected"),
}


OTHERS_MISTAKES = {
    "no ramp": ("quadrotor", "ramp_s.*", "", "ramp_s", "there is no [suspension]"),
    "all axes with four rotors": ("quadrotor", "axes.*", "", "axes", "x, y, z, yaw"),
    "tilt without z": ("quadrotor", '"z", ', "", "axes", "with z"),
    "rotors that push forward": (
        "quadrotor",
        r"= \[0\.0, 0\.0, 1\.0\]",
        "= [1.0, 0.0, 0.0]",
        "thrusters.units",
        "= [0.0, 0.0, 1.0]",
    ),
    "three rotors": ("quadrotor", r"(?m)^    \{.*\n", "", "thrusters.units", "at least 4"),
    "all spin one way": ("quadrotor", "spin = -1", "spin = 1", "thrusters.units", "z, roll, pitch"),
    "too heavy": ("quadrotor", "f_max_n = 7.0", "f_max_n = 3.2", "thrusters.f_max_n", "11.8 N"),
    "rotors to one side": (
        "quadrotor",
        r"body_m = \[-0\.159",
        "body_m = [0.05",
        "thrusters.f_max_n",
        "without turning",
    ),
    "fans that do not cancel": (
        "ground",
        r"(?m)^    \{ position_in_body_m = \[-0\.22.*\n",
        "",
        "thrusters.units",
        "cancel",
    ),
    "feet on one side": (
        "ground",
        r"\[-0\.22, 0\.0, -0\.1\]",
        "[0.22, 0.1, -0.1]",
        "stand.",
        "tips",
    ),
    "uneven feet": ("ground", r"0\.22, -0\.1\]", "0.22, -0.2]", "stand.feet", "at one height"),
    "an interval of a cable without one": (
        "quadrotor",
        r"\[air\]",
        "[identified.suspension]\nlength_m = { found = 1.0, half_95 = 0.1 }\n[air]",
        "identified.suspension",
        "only with [suspension]",
    ),
    "an attitude that nobody takes": (
        "copter",
        'takes = "attitude"',
        "",
        "attitude",
        "with link.takes = 'attitude'",
    ),
    "an attitude taken without saying how": (
        "quadrotor",
        "port = 47001",
        'port = 47001\ntakes = "attitude"',
        "attitude",
        "and with it alone",
    ),
    "who keeps it all the time": (
        "copter",
        "(?m)^ramp_s",
        "keeps_attitude_in_ramp = true\nramp_s",
        "keeps_attitude_in_ramp",
        "it keeps it all the time",
    ),
    "a flight controller's motors": (
        "copter",
        r"\[body_imu\]",
        '[flight_controller]\nstopped_by = "me"\nmotors = [1, 2, 3, 4]\n[body_imu]',
        "flight_controller",
        "takes = 'thrusts'",
    ),
    "more thrust than its autopilot's 1": (
        "copter",
        'takes = "attitude"',
        'takes = "attitude"\nkind = "mavlink"\nmavlink = { hover_thrust = 0.5 }',
        "thrusters.f_max_n",
        "5.88 or less",
    ),
    "another link's section": (
        "copter",
        'takes = "attitude"',
        'takes = "attitude"\nmavlink = { system = 2 }',
        "link.mavlink",
        "only with kind = 'mavlink'",
    ),
    "a lean beyond any": (
        "copter",
        "max_tilt_deg = 20.0",
        "max_tilt_deg = 60.0",
        "attitude.max_tilt",
        "45",
    ),
    "a word in the stand": ("ground", "friction =", "friktion =", "stand.frik", "mean 'friction'"),
}


@pytest.mark.parametrize("mistake", OTHERS_MISTAKES)
def test_a_mistake_of_a_robot_that_stands_is_named(changed, mistake):
    robot, pattern, replacement, key, allowed = OTHERS_MISTAKES[mistake]
    with pytest.raises(RobotFileError) as caught:
        changed(pattern, replacement, count=1 if "{" in pattern else 0, robot=robot)
    assert caught.value.key.startswith(key)
    assert allowed in caught.value.allowed


def test_a_number_that_was_changed_since_it_was_identified_has_no_interval(changed):
    found = identified("ames", 0.1)
    assert found.plant.intervals.outdated == ()
    text = with_intervals(TEXT, intervals_of(TEXT, 0.1), "for tests")
    by_hand = text.replace("mass_kg = 3.5", "mass_kg = 3.6").replace("[0.05, 0.05", "[0.05, 0.06")
    told = robot_of(tomllib.loads(by_hand), "by hand").plant.intervals
    assert told.outdated == ("body.inertia_kg_m2.1", "body.mass_kg")
    assert told == replace(
        found.plant.intervals,
        mass=None,
        inertia=(found.plant.intervals.inertia[0], None, found.plant.intervals.inertia[2]),
        outdated=told.outdated,
    )


def test_a_battery_is_judged_by_what_its_file_says(changed):
    assert AMES.battery is None
    with_one = changed(r"\[air\]", "[battery]\nlow_v = 10.5\nempty_v = 9.9\n[air]")
    assert with_one.battery == BatteryParameters(10.5, 9.9)


def test_axes_make_the_mask_of_the_robot(changed):
    assert AMES.robot.axes.all()
    assert changed("axes = .*", "").robot.axes.all()
    np.testing.assert_array_equal(QUADROTOR.robot.axes, [1, 1, 1, 0, 0, 1])
    np.testing.assert_array_equal(GROUND.robot.axes, [1, 1, 0, 0, 0, 1])


def test_a_quadrotor_tilts_to_go_sideways_and_carries_its_weight():
    robot = QUADROTOR.robot
    assert robot.needs_tilt
    np.testing.assert_array_equal(robot.wrench_axes, [0, 0, 1, 1, 1, 1])
    assert robot.weight_to_carry == pytest.approx(1.2 * GRAVITY)
    assert (robot.hangs, robot.ramp_s) == (False, 6.0)


def test_robots_carried_by_a_cable_or_the_floor_do_neither():
    for robot_file in (AMES, GROUND):
        robot = robot_file.robot
        assert not robot.needs_tilt
        assert robot.weight_to_carry == 0.0
        np.testing.assert_array_equal(robot.wrench_axes, robot.axes)
    assert GROUND.robot.ramp_s == 0.5


def test_a_simulated_phone_begins_level_with_a_robot_that_hangs_and_above_others():
    assert (AMES.start.distance, AMES.start.above, AMES.start.lift) == (2.5, 0.0, 0.0)
    assert (QUADROTOR.start.above, QUADROTOR.start.lift) == (0.9, 0.4)
    assert (GROUND.start.above, GROUND.start.lift) == (0.9, 0.0)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_with_file_key_and_what_is_allowed(changed, mistake):
    pattern, replacement, key, allowed = MISTAKES[mistake]
    with pytest.raises(RobotFileError) as caught:
        changed(pattern, replacement)
    assert caught.value.key.startswith(key)
    assert allowed in caught.value.allowed
    assert "changed.toml" in str(caught.value)


def test_thrusters_that_all_push_one_way_are_refused(changed):
    with pytest.raises(RobotFileError, match=r"axes: x, y, z, yaw.*sideways by roll and pitch"):
        changed(r"direction_in_body = \[[^\]]*\]", "direction_in_body = [0.0, 0.0, 1.0]", 8)


def test_thrusters_that_cannot_cancel_are_refused(changed):
    with pytest.raises(RobotFileError, match=r"thrusters\.units.*cancel"):
        changed(r"(direction_in_body = \[)(-?)(0\.\d+)", r"\1 \3", 8)


def test_leds_in_one_plane_are_refused(changed):
    with pytest.raises(RobotFileError, match="not in one plane"):
        changed(r"(\[\[leds\]\]\nposition_in_body_m = \[)[-\d.]+", r"\1-0.2", 5)


def test_leds_in_one_place_are_refused(changed):
    led = "[[leds]]\nposition_in_body_m = [-0.2, 0.1, 0.1]"
    with pytest.raises(RobotFileError, match=r"leds\.1.*from the others"):
        changed(r"\[\[leds\]\]\nposition_in_body_m = .*", led, 2)


def test_an_unknown_robot_is_refused_with_those_there_are():
    with pytest.raises(RobotFileError, match=r"ames.*did you mean 'ames'"):
        load_robot("amse")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(RobotFileError, match=r"nothing\.toml"):
        load_robot(tmp_path / "nothing.toml")


def test_all_robots_in_the_folder_load():
    for path in Path(ROBOTS).glob("*.toml"):
        robot_file = load_robot(path.stem, takes=COMMANDS)
        assert robot_file.robot.name == path.stem
        if robot_file.robot.twist is not None:
            continue
        assert robot_file.robot.hangs == (robot_file.plant.suspension is not None)
        assert robot_file.robot.hangs != (robot_file.plant.stand is not None)


def test_only_a_robot_that_does_not_hang_says_that_it_keeps_its_attitude():
    assert load_robot("quadrotor").keeps_attitude_in_ramp
    assert not load_robot("ames").keeps_attitude_in_ramp
    table = robot_table(ROBOTS / "ames.toml") | {"keeps_attitude_in_ramp": True}
    with pytest.raises(RobotFileError, match="keeps_attitude_in_ramp"):
        robot_of(table, "x.toml")


def test_a_robot_blinks_only_if_its_file_says_so():
    table = robot_table(ROBOTS / "ames.toml")
    assert load_robot("ames").robot.blinking_leds == 0
    assert not robot_of({k: v for k, v in table.items() if k != "blinks"}, "x").robot.blinks
    assert robot_of(table | {"blinks": True}, "x").robot.blinking_leds == 5


def test_a_robot_that_takes_a_twist_is_refused_where_only_thrusts_are_known():
    with pytest.raises(RobotFileError, match=r"link\.takes: 'twist'; here only .* thrusts"):
        load_robot("twister")
    drive = load_robot("twister", takes=COMMANDS).robot.twist
    assert (drive.speed, drive.rate) == (0.5, pytest.approx(np.pi / 2))


TWIST_MISTAKES = {
    "brakes too late": ("acceleration_m_s2 = 5.0", "acceleration_m_s2 = 4.0", "4.55 or more"),
    "turns too long": ("deg_s2 = 1000.0", "deg_s2 = 800.0", "818 or more"),
    "would swing": ("lag_s = 0.03", "lag_s = 0.3", "smaller: .* swing"),
    "misspelt": ("speed_m_s", "sped_m_s", "did you mean 'speed_m_s'"),
    "thrusters": ("[twist] ", "[thrusters]\n[twist] ", "unknown key; allowed here: .*twist"),
    "a battery": ("[twist] ", "[battery]\nlow_v = 1\nempty_v = 2\n[twist] ", "less than low_v"),
    "no numbers": ("speed_m_s = 0.5", "speed_m_s = nan", "finite"),
    "says not that": ('takes = "twist"', "", r"link\.takes: missing; .*'twist'"),
    "takes what": ('takes = "twist"', 'takes = "twits"', r"link\.takes: 'twits'; .*'twist'"),
    "LEDs in one place": ("[-0.089, 0.053, 0.140]", "[-0.012, -0.084, -0.117]", "from the others"),
}


MOTION_MISTAKES = {
    "nothing of its motion": ("[motion]", "[motions]", "unknown key; did you mean 'motion'"),
    "sensors as well": (
        "[start]",
        "[body_imu]\ngyro_noise_deg_s_rthz = 0.0\nacc_noise_ug_rthz = 0.0\ngyro_bias_deg_s = 0.0\n"
        "acc_bias_mg = 0.0\ngyro_step_deg_s = 0.0\nacc_step_mg = 0.0\n[start]",
        r"motion: only without \[body_imu\]",
    ),
    "level, and led about x": ('"yaw"]', '"yaw", "roll"]', "motion.stands_level: false: .*roll"),
    "measured at no rate": ("rate_hz = 20.0", "", "motion.rate_hz: missing"),
    "commanded at a rate": ('"measured"', '"commanded"', "motion.rate_hz: only with .*'measured'"),
    "known by a guess": ('"measured"', '"guessed"', "motion.twist: .*'measured' or 'commanded'"),
    "no word of the vertical": ("stands_level", "stands_levl", "did you mean 'stands_level'"),
    "measured too seldom": ("rate_hz = 20.0", "rate_hz = 2.0", "motion.rate_hz: .*5"),
    "a hill": ("tilt_deg = 2.0", "tilt_deg = 40.0", "motion.tilt_deg: .*15"),
}


ARM_MISTAKES = {
    "a mesh for a model": ('"so101.xml"', '"so101.stl"', "arm.model: "),
    "a model elsewhere": ('"so101.xml"', '"../so101.xml"', "arm.model: "),
    "misspelt": ("joint_speed_deg_s", "joint_sped_deg_s", "did you mean 'joint_speed_deg_s'"),
    "no home": ("home_deg = [0.0, -34.0, 57.0, -23.0, 2.79]", "home_deg = []", "arm.home_deg: "),
    "a part apart": ('["palm_ball", "base"]', '["palm_ball"]', "arm.keeps_apart.5: .*2 items"),
    "no speed": ("joint_speed_deg_s = 120.0", "joint_speed_deg_s = 0.0", "arm.joint_speed_deg_s"),
    "a tool of no joint": ('tool_joint = "gripper"', "", r"arm.tool_joint: with \[tool\]"),
    "a nameless tool": ('name = "Gripper"', 'name = ""', "tool.name: "),
}


MISTAKEN = {"twister": TWIST_MISTAKES, "rover": MOTION_MISTAKES, "so101": ARM_MISTAKES}


@pytest.mark.parametrize(
    ("robot", "mistake"), [(robot, one) for robot, table in MISTAKEN.items() for one in table]
)
def test_a_mistake_of_a_robot_that_takes_a_twist_is_named(tmp_path, robot, mistake):
    old, new, allowed = MISTAKEN[robot][mistake]
    text = robot_path(robot).read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "changed.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(RobotFileError, match=allowed):
        load_robot(tmp_path / "changed.toml", takes=COMMANDS)


def test_the_model_of_an_arm_lies_beside_its_file(tmp_path):
    text = robot_path("so101").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    for file, folder in (("so101", ROBOTS), (tmp_path / "mine.toml", tmp_path)):
        arm = load_robot(file, takes=COMMANDS).plant.arm
        assert arm.model == folder / "so101.xml"
        assert arm.home == pytest.approx(np.radians([0.0, -34.0, 57.0, -23.0, 2.79]))
        assert arm.rate == pytest.approx(np.radians(120.0))
    assert load_robot("twister", takes=COMMANDS).plant.arm is None


def test_a_robot_that_takes_a_twist_has_motion_sensors_or_says_what_it_tells(tmp_path):
    table = robot_table(robot_path("rover"))
    del table["motion"]
    with pytest.raises(RobotFileError, match=r"body_imu: missing: \[body_imu\], or \[motion\]"):
        robot_of(table, "rover")
    told = robot_of(table | {"motion": {"twist": "commanded", "stands_level": True}}, "rover")
    measured = load_robot("rover", takes=COMMANDS).robot.motion
    assert told.plant.odometry is None
    assert told.robot.motion.slip > measured.slip
    assert told.robot.motion.unlike_s > measured.unlike_s


def test_what_pushes_every_way_takes_no_attitude():
    table = robot_table(robot_path("ames"))
    section = robot_table(robot_path("copter"))["attitude"]
    link = table["link"] | {"takes": "attitude"}
    with pytest.raises(RobotFileError, match=r"link\.takes: 'thrusts'"):
        robot_of(table | {"attitude": section, "link": link}, "x")


def test_how_a_copter_follows_is_in_si():
    drive = load_robot("copter", takes=COMMANDS).robot.attitude
    assert (drive.max_tilt, drive.yaw_rate) == pytest.approx((0.349066, 1.570796), abs=1e-6)
    assert (drive.lag_s, drive.delay_s, drive.yaw_lag_s) == (0.15, 0.02, 0.1)


def test_who_knows_thrusts_alone_is_not_given_a_copter():
    with pytest.raises(RobotFileError, match="'attitude'; here only robots that take thrusts"):
        load_robot("copter")
