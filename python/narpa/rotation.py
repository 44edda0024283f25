"""Rotations: unit quaternions (w, x, y, z), Hamilton's convention. An attitude rotates body coordinates into world
coordinates."""
import numpy as np


def product(a, b):
    """The rotation by b, then by a."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    return np.append(a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))


def conjugate(q):
    """The inverse rotation."""
    return np.asarray(q, float) * [1, -1, -1, -1]


def rotate(q, vector):
    return product(product(q, np.append(0, vector)), conjugate(q))[1:]


def to_matrix(q):
    """The (3, 3) matrix whose product with a vector is rotate(q, vector)."""
    return np.array([rotate(q, axis) for axis in np.eye(3)]).T


def from_vector(rotation_vector):
    """The rotation by the angle |v| (rad) about the axis v."""
    v = np.asarray(rotation_vector, float)
    angle = np.linalg.norm(v)
    return np.append(np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) / 2 * v)


def to_vector(q):
    """The shortest rotation vector, rad."""
    q = np.asarray(q, float) * (1 if q[0] >= 0 else -1)
    length = np.linalg.norm(q[1:])
    return q[1:] * (2 * np.arctan2(length, q[0]) / length if length > 1e-12 else 2)


def angle(a, b):
    """The angle between two attitudes, rad."""
    return np.linalg.norm(to_vector(product(conjugate(a), b)))


def advanced(attitude, rate, seconds):
    """The attitude after a rotation at a constant rate, rad/s in body axes."""
    q = product(attitude, from_vector(np.asarray(rate, float) * seconds))
    return q / np.linalg.norm(q)
