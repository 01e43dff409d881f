"""What a user writes, for mypy: `make lint` accepts this, and refuses each line marked `ignore`."""

from fractions import Fraction

import numpy as np

from gpbnb import (
    BINARY32,
    FixedFormat,
    FloatFormat,
    Form,
    LinearModel,
    LinearSystem,
    emulate,
    guarantee,
    limits,
    linalg,
    read_model,
    required_precision,
    survey_records,
)

fmt = FloatFormat(base=10, precision=8, rounding="chop")
x, y = fmt.array(["0.1", "2.5", "-3"]), fmt.array(["7", "1e-3", "0.2"])
print(float(linalg.dot(x, y)), np.sqrt(x * x) @ x.T, 2 * x + y, np.stack([x, y]) @ x, np.where(x > 0, x, y))
cart = LinearModel(
    Phi=[[1, "0.1"], [0, 1]],
    H=[[1, 0]],
    Q=[["1e-6", 0], [0, "1e-4"]],
    R=[["0.04"]],
    x0=[0, 0],
    P0=np.eye(2),
    B=lambda k: [["0.005"], ["0.1"]],
    u=[[1], [1], [0]],
    d=[Fraction(1, 2)],
    state_names=["position (m)", "speed"],
)
answer = required_precision(cart, 3, [0.01, np.inf], rounding="chop", form="UD", basis="bound")
if isinstance(answer.format, FloatFormat) and answer.digits is not None:
    print(FloatFormat(2, answer.digits + 2).unit_roundoff, answer.format.largest)
system = LinearSystem([["0.9"]], [["0.1"]], name="smoother", input_names=("u",))
print(required_precision(system, [[1], [2], [3], [4]], 0.01), required_precision("model.toml", 4, 0.01))
walk = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])
print(guarantee(walk, BINARY32, limits(state=10, innovation=5), form="UD").bound)
print(emulate(walk, np.ones((3, 1)), "float32", form=Form.UD).errors)
print(survey_records(walk, 3, 0.01, [FloatFormat(2, 4), BINARY32], steps=20).shares)
print(read_model({"A": [[1]], "B": [[1]]}))
print(FixedFormat(0, 15, "floor", "saturate").zeros((2, 2)).to_bits(), BINARY32.from_bits([0, 1]).to_float())

FloatFormat("2", 8)  # type: ignore[arg-type]
LinearModel([[1]], [[1]], [[1]], [[1]], [0], [[1j]])  # type: ignore[list-item]
LinearModel(None, [[1]], [[1]], [[1]], [0], [[1]])  # type: ignore[arg-type]
required_precision({"A": [[1]], "B": [[1]]}, 3, 0.1, basis="certainty")  # type: ignore[arg-type]
