"""The numbers of a format, what it makes, and its bits, compared with NumPy, ml_dtypes and struct."""

from __future__ import annotations

import struct
from fractions import Fraction

import ml_dtypes
import numpy as np
import pytest

import gpbnb
from gpbnb import BINARY64, BINARY128, IBM_704, IBM_HEX32, TF32, FixedFormat

Q15 = FixedFormat(0, 15)
NATIVE = {
    "BINARY16": (np.float16, np.uint16),
    "BINARY32": (np.float32, np.uint32),
    "BINARY64": (np.float64, np.uint64),
    "BFLOAT16": (ml_dtypes.bfloat16, np.uint16),
    "FP8_E4M3": (ml_dtypes.float8_e4m3fn, np.uint8),
    "FP8_E5M2": (ml_dtypes.float8_e5m2, np.uint8),
    "FP6_E3M2": (ml_dtypes.float6_e3m2fn, np.uint8),
    "FP6_E2M3": (ml_dtypes.float6_e2m3fn, np.uint8),
    "FP4_E2M1": (ml_dtypes.float4_e2m1fn, np.uint8),
}


@pytest.mark.parametrize("name", NATIVE)
def test_the_numbers_of_a_format_are_those_of_the_type(name):
    fmt, (native, _) = getattr(gpbnb, name), NATIVE[name]
    info = ml_dtypes.finfo(native)
    found = [float(each) for each in (fmt.largest, fmt.smallest_normal, fmt.smallest, fmt.unit_roundoff)]
    assert found == [float(each) for each in (info.max, info.tiny, info.smallest_subnormal, info.eps / 2)]
    assert all(type(each) is Fraction for each in (fmt.largest, fmt.smallest_normal, fmt.smallest))


@pytest.mark.parametrize("name", NATIVE)
def test_every_word_stores_the_number_of_the_type(name):
    """All words of 8 and 16 bits, and many of more."""
    fmt, (native, unsigned) = getattr(gpbnb, name), NATIVE[name]
    bits = fmt.layout.width
    if bits <= 8:
        every = np.arange(2**bits, dtype=unsigned)
    else:
        some = np.random.default_rng(7).integers(0, 2**bits, 4000, dtype=unsigned, endpoint=False)
        least = np.arange(40, dtype=unsigned)  # zero and subnormal numbers
        every = np.concatenate([some, least, least + unsigned(2 ** (bits - 1))])
    values = every.view(native)
    with np.errstate(invalid="ignore"):  # signalling NaNs
        finite = np.isfinite(values.astype(np.float64))
    found = fmt.from_bits(every[finite])
    assert found.to_float().tolist() == values[finite].astype(np.float64).tolist()
    back = found.to_bits()
    assert back.dtype == unsigned
    zero = values[finite] == 0
    assert not back[zero].any()  # there is no negative zero
    assert back[~zero].tolist() == every[finite][~zero].tolist()
    for word in every[~finite][:5].tolist():
        with pytest.raises(ValueError, match=f"got bits {word:#x}, which are infinity, NaN or beyond the range"):
            fmt.from_bits(word)


def test_words_of_other_machines():
    """118.625 in hexadecimal floating point is the textbook's example; the 704 stored 1/2 with characteristic 128."""
    assert IBM_HEX32.array("-118.625").to_bits() == 0xC276A000
    assert IBM_HEX32.from_bits(0xC276A000).to_fractions() == Fraction("-118.625")
    assert IBM_704.array("0.5").to_bits() == (128 << 27) | (1 << 26)
    assert (IBM_704.layout.width, TF32.layout.width, BINARY128.layout.width) == (36, 19, 128)
    assert BINARY128.array(1).to_bits() == 0x3FFF << 112
    assert BINARY128.array([1]).to_bits().dtype == object
    assert BINARY64.array(["0.1"]).to_bits().tolist() == list(struct.unpack("<Q", struct.pack("<d", 0.1)))
    assert Q15.array(["-1", "0.5", "-0.25"]).to_bits().tolist() == [0x8000, 0x4000, 0xE000]
    assert (Q15.smallest, Q15.largest, Q15.lowest) == (Fraction(1, 2**15), 1 - Fraction(1, 2**15), -1)
    assert Q15.from_bits([0x8000, 0x4000, 0xE000]).to_float().tolist() == [-1, 0.5, -0.25]
