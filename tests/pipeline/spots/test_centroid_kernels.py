"""The compiled centroid against a readable one, and what stands behind a spot."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from pipeline.signals import Frame
from pipeline.spots import ground_kernels as of_ground
from pipeline.spots.centroid_kernels import (
    AREA,
    BY_RELIEF,
    C_UU,
    C_UV,
    C_VV,
    CONTRAST,
    DARKEST,
    GROWN,
    MOST_ABOVE,
    MOST_OFF,
    NOISE,
    RING,
    SIZE_SHARE,
    UU,
    UV,
    VV,
    U,
    V,
)
from pipeline.spots.leds import light_of, measured
from pipeline.spots.spot_kernels import LEAST_GREY, SHARES
from pipeline.vision_config import LedsConfig

MIDDLE, HALF = 40, 14
LIGHT, SLOPE = light_of(True)


def picture(rng=None, place=(40.2, 39.7), peak=600.0, sigma=1.4, behind=None, noise=0.0):
    """Grey levels of a spot in linear light on a ground `behind` it, clipped."""
    v, u = np.mgrid[: 2 * MIDDLE + 1, : 2 * MIDDLE + 1].astype(float)
    light = np.full(u.shape, 4.0) if behind is None else behind.copy()
    light += peak * np.exp(-0.5 * ((u - place[0]) ** 2 + (v - place[1]) ** 2) / sigma**2)
    grey = 255.0 * (np.clip(light, 0.0, 255.0) / 255.0) ** (1.0 / 2.2)
    if rng is not None:
        grey = grey + rng.normal(0.0, noise, grey.shape)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)


def arm(bright, dark=4.0, angle=0.6, width=5.0):
    """The light of an arm from the picture's middle outwards."""
    v, u = np.mgrid[: 2 * MIDDLE + 1, : 2 * MIDDLE + 1] - float(MIDDLE)
    along, across = u * np.cos(angle) + v * np.sin(angle), v * np.cos(angle) - u * np.sin(angle)
    return np.where((along > 0.0) & (np.abs(across) < 0.5 * width), bright, dark)


def compiled(luma, half=HALF):
    table = measured(Frame(0.0, luma), np.array([[MIDDLE, MIDDLE, half]]), LedsConfig())
    return table[0]


def ring_of(luma, left, top, right, bottom):
    """A box's border, clockwise from its upper left corner."""
    return np.concatenate(
        (
            luma[top, left:right],
            luma[top:bottom, right],
            luma[bottom, right:left:-1],
            luma[bottom:top:-1, left],
        )
    ).astype(float)


def middle_of(ring):
    """The lower one of two, as a grey level."""
    return np.sort(ring)[(len(ring) - 1) // 2]


def readable_ground(luma, box, level, most):
    """Light of the ground under each pixel in a box: what the box shows along its arms' axis."""
    left, top, right, bottom = box
    middle = np.array([0.5 * (left + right), 0.5 * (top + bottom)])
    v, u = np.mgrid[: luma.shape[0], : luma.shape[1]]
    on = np.zeros(luma.shape, bool)
    on[top : bottom + 1, [left, right]] = on[[top, bottom], left : right + 1] = True
    relief = np.abs(np.minimum(LIGHT[luma] - level, most))[on]
    double = np.exp(2j * np.arctan2(v[on] - middle[1], u[on] - middle[0]))
    mean = (relief * double).sum() / relief.sum()
    axis = np.array([np.cos(0.5 * np.angle(mean)), np.sin(0.5 * np.angle(mean))])

    def met(way):
        with np.errstate(divide="ignore"):
            steps = [
                (np.where(w > 0.0, high, low) - x) / w
                for w, low, high, x in zip(way, (left, top), (right, bottom), (u, v), strict=True)
            ]
        step = np.minimum(*steps)
        return map_coordinates(LIGHT[luma], [v + step * way[1], u + step * way[0]], order=1)

    ahead = np.clip(0.5 + 0.5 * ((u - middle[0]) * axis[0] + (v - middle[1]) * axis[1]), 0.0, 1.0)
    there = ahead * met(axis) + (1.0 - ahead) * met(-axis)
    return level + abs(mean) * np.minimum(there - level, most)


def readable(luma, half=HALF):
    """Place, moments, noise and area of the brightest spot about a picture's middle."""
    corner = MIDDLE - half
    part = luma[corner : corner + 2 * half + 1, corner : corner + 2 * half + 1]
    ground = middle_of(ring_of(part, 0, 0, 2 * half, 2 * half))
    peak = np.unravel_index(np.argmax(part), part.shape)
    for share in SHARES:
        edge = ground + share * (int(part[peak]) - ground)
        labels = cv2.connectedComponents((part > edge).astype(np.uint8), connectivity=8)[1]
        members = labels == labels[peak]
        if not (members[[0, -1]].any() or members[:, [0, -1]].any()):
            break
        assert part[peak] - edge >= LEAST_GREY
    grown = cv2.dilate(members.astype(np.uint8), np.ones((2 * GROWN + 1, 2 * GROWN + 1))) > 0
    rows, columns = np.nonzero(members)
    left, right = columns.min() - RING, columns.max() + RING
    top, bottom = rows.min() - RING, rows.max() + RING
    ring = ring_of(luma, *(corner + np.array([left, top, right, bottom])))
    level = LIGHT[int(middle_of(ring))]
    bends = np.abs(np.roll(ring, 2) - 2.0 * ring + np.roll(ring, -2))
    calm = bends[bends < of_ground.MOST_BEND]
    noise = max(np.sqrt((calm**2).sum() / 6.0 / max(len(calm), 1)), of_ground.FEWEST_NOISE)
    noise *= 1.0 + max(0.0, 1.0 - 0.5 * middle_of(ring) / noise)
    rise = LIGHT[part[members]].max() - level
    is_parted = share > SHARES[0]
    most = max(MOST_OFF * rise, is_parted * LIGHT[int(edge)] - level)
    off = np.minimum(LIGHT[ring.astype(int)] - level, most)
    relief = np.mean([np.roll(off, k) for k in range(-of_ground.BESIDE, of_ground.BESIDE + 1)], 0)
    grain = noise * SLOPE[int(middle_of(ring)) + DARKEST]
    relief2 = max(0.0, (relief**2).mean() - grain**2 / (2 * of_ground.BESIDE + 1))
    share = min(BY_RELIEF * np.sqrt(relief2) / rise, MOST_ABOVE)
    v, u = np.mgrid[: part.shape[0], : part.shape[1]].astype(float)
    ground = readable_ground(part, (left, top, right, bottom), level, most)
    led = np.where(grown, (LIGHT[part] - ground) / (level + rise - ground), 0.0)
    weight = (led - share).clip(0.0)
    at = np.array([(weight * u).sum(), (weight * v).sum()]) / weight.sum()
    du, dv = u - at[0], v - at[1]
    second = [(weight * a).sum() / weight.sum() for a in (du * du, du * dv, dv * dv)]
    area = ((weight > 0.0) & (led > SIZE_SHARE)).sum()
    return [*(corner + at), *second, noise, area]


@pytest.mark.parametrize(
    "behind", [None, arm(40.0), arm(4.0, 40.0), arm(30.0, angle=2.4), arm(200.0)]
)
@pytest.mark.parametrize("peak", [120.0, 600.0])
def test_the_compiled_centroid_is_the_readable_one(behind, peak):
    rng = np.random.default_rng(1)
    for _ in range(4):
        luma = picture(rng, 40.0 + rng.uniform(-1.0, 1.0, 2), peak, 1.4, behind, 1.0)
        spot = compiled(luma)
        np.testing.assert_allclose(spot[[U, V, UU, UV, VV, NOISE, AREA]], readable(luma), atol=1e-6)


@pytest.mark.parametrize(
    ("behind", "px"),
    [
        (arm(25.0), 0.08),
        (arm(4.0, 25.0), 0.08),
        (arm(25.0, angle=-2.0, width=9.0), 0.08),
        (arm(60.0, angle=2.0, width=3.0), 0.13),
        (arm(60.0), 0.17),
        (arm(100.0), 0.34),
    ],
)
def test_a_bright_arm_behind_a_spot_hardly_displaces_it(behind, px):
    """Were the ground even, by up to 0.10, 0.10, 0.10, 0.19, 0.25 and 0.64 px."""
    for place in ((40.0, 40.0), (40.3, 39.6), (39.8, 40.5)):
        spot = compiled(picture(place=place, behind=behind))
        assert np.hypot(spot[U] - place[0], spot[V] - place[1]) < px


@pytest.mark.parametrize("bright", [140.0, 180.0, 220.0])
@pytest.mark.parametrize("angle", [0.6, -2.0])
def test_a_spot_on_an_arm_nearly_as_bright_is_found_and_sure_to_its_error(bright, angle):
    """White paint in the sun: no share of the contrast above the room's parts both."""
    rng = np.random.default_rng(2)
    for _ in range(4):
        place = 40.0 + rng.uniform(-0.5, 0.5, 2)
        spot = compiled(picture(rng, place, behind=arm(bright, angle=angle), noise=1.0))
        off = spot[[U, V]] - place
        C = np.array([[spot[C_UU], spot[C_UV]], [spot[C_UV], spot[C_VV]]])
        assert np.hypot(*off) < 1.6
        assert off @ np.linalg.solve(C, off) < 13.8  # 99.9 %


def test_a_large_spot_in_a_bright_room_is_as_sure_as_in_a_dark_one():
    """No arm is parted from it, though the room is as bright as one."""
    dark, bright = (
        compiled(picture(peak=2000.0, sigma=3.5, behind=np.full((81, 81), room)), half=21)
        for room in (4.0, 120.0)
    )
    assert bright[C_UU] + bright[C_VV] < 2.0 * (dark[C_UU] + dark[C_VV])


def test_a_ground_of_two_sides_makes_a_spot_less_sure():
    plain, before_arm = compiled(picture()), compiled(picture(behind=arm(40.0)))
    assert before_arm[C_UU] + before_arm[C_VV] > 2.0 * (plain[C_UU] + plain[C_VV])


def test_noise_is_told_by_the_ring_and_grain_is_not_taken_for_ground():
    rng = np.random.default_rng(2)
    told = [
        compiled(picture(rng, behind=np.full((81, 81), 40.0), noise=4.0))[NOISE] for _ in range(20)
    ]
    assert np.mean(told) == pytest.approx(4.0, rel=0.15)


def test_a_dim_spot_is_measured_where_nothing_brighter_is_around():
    dim = picture(peak=6.0, sigma=2.5)
    assert compiled(dim)[CONTRAST] < LedsConfig().min_contrast / 2.0
    np.testing.assert_allclose(compiled(dim)[[U, V]], (40.2, 39.7), atol=0.1)


def test_a_spot_four_times_dimmer_than_its_neighbour_is_none():
    luma = picture(peak=255.0)
    luma[36:39, 48:51] = np.maximum(luma[36:39, 48:51], luma[0, 0] + 30)
    assert len(measured(Frame(0.0, luma), np.array([[MIDDLE, MIDDLE, HALF]]), LedsConfig())) == 1


@pytest.mark.parametrize("peak", [500.0, 900.0])
def test_a_sharp_spot_of_few_pixels_is_about_as_unsure_as_it_is_off(peak):
    """Its clipped light is the same wherever in a pixel it is, but at its steep edges."""
    rng, squares = np.random.default_rng(3), []
    for place in 40.0 + rng.uniform(-0.5, 0.5, (80, 2)):
        spot = compiled(picture(rng, place, peak, 0.45, noise=1.0))
        squares.append(0.5 * ((spot[[U, V]] - place) ** 2 / spot[[C_UU, C_VV]]).sum())
    assert 0.1 < np.mean(squares) < 5.0


@pytest.mark.parametrize("corner", [(39, 39), (40, 41)])
def test_two_by_two_pixels_are_a_spot_and_one_is_none(corner):
    u, v = corner
    luma = np.full((81, 81), 30, np.uint8)
    luma[v, u] = 250
    window = np.array([[MIDDLE, MIDDLE, HALF]])
    assert len(measured(Frame(0.0, luma), window, LedsConfig())) == 0
    luma[v : v + 2, u : u + 2] = 250
    (spot,) = measured(Frame(0.0, luma), window, LedsConfig())
    np.testing.assert_allclose(spot[[U, V, AREA]], (u + 0.5, v + 0.5, 4.0))
