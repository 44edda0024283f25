"""narpa.rotation: identities of rotations, also at and near angles of 0 and 180 degrees."""
import unittest

import needs

needs.modules("numpy")

import numpy as np
from narpa import rotation

VECTORS = [np.zeros(3), np.array([1e-9, 0, 0]), np.array([0, 0, np.pi - 1e-6]), *np.random.default_rng(1).normal(0, 0.9, (20, 3))]


class Rotations(unittest.TestCase):
    def test_vectors_come_back(self):
        for v in VECTORS:
            np.testing.assert_allclose(rotation.to_vector(rotation.from_vector(v)), v, atol=1e-9)
            np.testing.assert_allclose(rotation.to_vector(-rotation.from_vector(v)), v, atol=1e-9)

    def test_turns_forward_to_left_about_up(self):
        quarter = rotation.from_vector([0, 0, np.pi / 2])
        np.testing.assert_allclose(rotation.rotate(quarter, [1, 0, 0]), [0, 1, 0], atol=1e-15)
        np.testing.assert_allclose(rotation.rotate(rotation.conjugate(quarter), [0, 1, 0]), [1, 0, 0], atol=1e-15)

    def test_the_second_factor_turns_first(self):
        a, b, v = rotation.from_vector(VECTORS[4]), rotation.from_vector(VECTORS[5]), [1, 2, 3]
        np.testing.assert_allclose(rotation.rotate(rotation.product(a, b), v), rotation.rotate(a, rotation.rotate(b, v)))

    def test_a_constant_rate_turns_by_rate_times_time(self):
        for v in VECTORS:
            q = rotation.advanced(np.array([1.0, 0, 0, 0]), v / 2, 2)
            self.assertAlmostEqual(rotation.angle([1, 0, 0, 0], q), np.linalg.norm(v), places=9)


if __name__ == "__main__":
    unittest.main()
