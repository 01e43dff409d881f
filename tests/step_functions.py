"""Steps of systems that a user might write; they run with arrays of a format, and with NumPy's arrays of float32."""

import numpy as np

from gpbnb import NonlinearSystem


def tracked_motion(x):
    """The next x, y and velocities of a target, after one second."""
    return np.stack([x[0] + x[2], x[1] + x[3], x[2], x[3]])


def tracked_sight(x):
    """Range and bearing of a target from the origin."""
    return np.stack([np.hypot(x[0], x[1]), np.arctan2(x[1], x[0])])


class Native:
    """A format whose arrays are NumPy's own, so that the processor rounds."""

    def __init__(self, dtype):
        self.dtype = dtype

    def array(self, values):
        return np.array(values).astype(self.dtype)


def clipped_controller(fmt, x, u):
    """A PI controller with a clipped integral and a clipped command, and the plant that it moves."""
    integral, y = x
    kp, ki, decay, gain, low, high = fmt.array(["0.8", "0.05", "0.95", "0.05", -1, 1])
    e = u[0] * 4 - y
    integral = np.clip(integral + ki * e, low, high)
    command = np.clip(kp * e + integral, low, high)
    return np.stack([integral, decay * y + gain * command]), np.stack([command])


def wrapped_angle(fmt, x, u):
    """An angle that stays between -180 and 180 degrees, and a rate that follows it."""
    turn, half, quarter, slow = fmt.array([360, 180, 90, "0.25"])
    angle = (x[0] + u[0] * 200 + half) % turn - half
    rate = x[1] * slow + np.fmod(angle, quarter) / turn
    return np.stack([angle, rate]), np.stack([angle, -rate])


def normalised_quaternion(fmt, q, u):
    """A quaternion that turns by small angles and is scaled to length one."""
    w, x, y, z = q
    a, b, c = u / 8
    w, x, y, z = (
        w - ((x * a + y * b) + z * c),
        x + ((w * a + y * c) - z * b),
        y + ((w * b + z * a) - x * c),
        z + ((w * c + x * b) - y * a),
    )
    length = np.sqrt((w * w + x * x) + (y * y + z * z))
    return np.stack([w, x, y, z]) / length, np.stack([2 * (w * z + x * y), length])


def chosen_branches(fmt, x, u):
    """Comparisons, choices and whole numbers of every kind."""
    a, b = u
    tenth, most, third, one = fmt.array(["0.1", "0.7", "0.33", 1])
    loud = (abs(a) > tenth) & ~(x[0] < 0)
    quiet = (b >= a) | (x[1] == b) ^ (a != b)
    g = np.where(loud, x[0] * most - a, np.where(quiet, x[0] + b, tenth - x[0] / 2))
    h = np.where(g > one, a, np.where(loud ^ quiet, g, x[1] * third))
    least = np.maximum(np.minimum(g, b), -tenth)
    whole = [np.floor(a * 8) / 4, np.ceil(b * 8) / 4, np.rint(a * 8 + b) / 4, np.trunc(b * 6) / 4]
    return np.stack([np.clip(g, -2, 2), h]), np.stack([least, np.where(~quiet, g, h), *whole])


SYSTEMS = [
    NonlinearSystem(clipped_controller, [0, "0.5"], 1, "a PI controller with two clips"),
    NonlinearSystem(wrapped_angle, ["170.25", 0], 1, "a wrapped angle"),
    NonlinearSystem(normalised_quaternion, [1, 0, 0, 0], 3, "a normalised quaternion"),
    NonlinearSystem(chosen_branches, [0, "0.5"], 2, "choices"),
]
