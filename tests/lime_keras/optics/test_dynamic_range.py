"""Compressed radiance: a round trip up to the ceiling, gradients at both ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lime_keras.optics.dynamic_range import HIGHEST_COMPRESSED, compress, expand

CEILING = np.expm1(HIGHEST_COMPRESSED)


@given(st.floats(0, CEILING))
def test_round_trip(radiance):
    assert expand(compress(radiance)) == pytest.approx(radiance, rel=1e-12)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_expanding_stays_in_range(compressed):
    assert 0 <= expand(compressed) <= CEILING
    assert compress(compressed) >= 0


def test_dim_light_is_kept_and_zero_stays_zero():
    assert compress(0.0) == expand(0.0) == 0
    assert compress(-3.0) == expand(-3.0) == 0
    assert compress(1e-20) == pytest.approx(1e-20)
    assert expand(np.float32(1e-20)) == pytest.approx(1e-20)
    assert compress(np.e - 1) == pytest.approx(1)
