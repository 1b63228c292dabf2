"""Spots of a robot's LEDs and of lamps, without a picture; and what a search makes of them."""

import numpy as np

from pipeline.frames import exp
from pipeline.identification.explanations import SURE, rivals
from pipeline.identification.relocalisation import Relocalisation, SearchHints
from pipeline.signals import Spots
from pipeline.vision_config import IdentifyConfig
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, is_wrong

CONFIG = IdentifyConfig()
NOISE_PX = 0.04
AREA_PX = 20.0


def spots_of(pixels, areas=None, brightness=None):
    """In the order of brightness, as the detector gives them."""
    n = len(pixels)
    brightness = np.ones(n) if brightness is None else np.asarray(brightness, dtype=float)
    areas = np.full(n, AREA_PX) if areas is None else np.asarray(areas, dtype=float)
    order = np.argsort(-brightness, kind="stable")
    covariances = np.tile(NOISE_PX**2 * np.eye(2), (n, 1, 1))
    return Spots(np.asarray(pixels)[order], covariances, brightness[order], areas[order])


def lamps_beside(pixels, count, rng, apart_px=25.0):
    """Lamps anywhere in the picture, but not on top of the others."""
    lights = [*pixels]
    while len(lights) < len(pixels) + count:
        lamp = rng.uniform(0.02, 0.98, 2) * (CAMERA.width, CAMERA.height)
        if not lights or np.linalg.norm(np.array(lights) - lamp, axis=1).min() > apart_px:
            lights.append(lamp)
    return np.array(lights[len(pixels) :]).reshape(-1, 2)


def seen(truth, rng, leds=range(5), lamps=0):
    """Spots of some LEDs among lamps that are as bright."""
    pixels = truth.pixels()[list(leds)]
    pixels = pixels + rng.normal(0.0, NOISE_PX, pixels.shape)
    pixels = np.vstack((pixels, lamps_beside(truth.pixels(), lamps, rng)))
    return spots_of(pixels, brightness=rng.uniform(1.0, 2.0, len(pixels)))


def hints_of(truth, tilt=None, gravity=True):
    if not gravity:
        return SearchHints()
    prior = truth.prior()
    up_in_c = prior.up_in_c if tilt is None else exp(tilt) @ prior.up_in_c
    return SearchHints(up_in_c, prior.up_in_b)


def best(spots, hints, search=None):
    """The explanation that is sure and has no rival."""
    found = (search or Relocalisation(CAMERA, LEDS_IN_B, CONFIG)).explanations(spots, hints)
    if not found or found[0].log_false_alarms > SURE or len(rivals(found)) > 1:
        return None
    return found[0]


def explains_truly(one, truth, spots):
    at = truth.pixels()[one.match.led]
    named = np.linalg.norm(spots.pixels[one.match.spot] - at, axis=1).max() < 1.0
    return named and not is_wrong(one, truth)
