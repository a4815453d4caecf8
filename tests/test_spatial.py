"""Spatial algebra in compiled code against Pinocchio's functions of the same name."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from lhpost6_pin.mechanics import spatial

RNG = np.random.default_rng(0)
FREE, GUIDED = np.arange(6), np.array([0])
MODEL = pin.Model()
MODEL.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "platen")
LOCAL = pin.ReferenceFrame.LOCAL

Values = tuple[np.ndarray, ...]


def filled(kernel: Callable, *args: object, shape: tuple[int, ...]) -> np.ndarray:
    """What a kernel fills its last argument with."""
    out = np.zeros(shape)
    kernel(*args, out)
    return out


def se3(x: Values) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(x[0]), x[1])


def rate_matrix(x: Values) -> np.ndarray:
    return pin.rpy.computeRpyJacobian(x[0], LOCAL)


def drift(x: Values) -> np.ndarray:
    return pin.rpy.computeRpyJacobianTimeDerivative(x[0], x[1], LOCAL) @ x[1]


def moved(x: Values) -> np.ndarray:
    return pin.integrate(MODEL, pin.SE3ToXYZQUAT(se3(x)), np.concatenate([x[2], x[3]]))


# x: Euler angles up to 1.5 rad, then three vectors of numbers up to 2
CASES: dict[str, tuple[Callable[[Values], object], Callable[[Values], object]]] = {
    "cross": (lambda x: spatial.cross(x[1], x[2]), lambda x: pin.skew(x[1]) @ x[2]),
    "from_body": (lambda x: spatial.from_body(se3(x).rotation, x[2]), lambda x: se3(x).rotation @ x[2]),
    "to_body": (lambda x: spatial.to_body(se3(x).rotation, x[2]), lambda x: se3(x).rotation.T @ x[2]),
    "act_force": (
        lambda x: np.ravel(spatial.act_force(se3(x).rotation, x[1], x[2], x[3])),
        lambda x: pin.SE3(se3(x).rotation, -se3(x).rotation @ x[1]).act(pin.Force(x[2], x[3])).vector,
    ),
    "quaternion_to_matrix": (
        lambda x: filled(spatial.quaternion_to_matrix, *pin.SE3ToXYZQUAT(se3(x))[3:], shape=(3, 3)),
        lambda x: se3(x).rotation,
    ),
    "rpy_to_matrix": (lambda x: filled(spatial.rpy_to_matrix, x[0], shape=(3, 3)), lambda x: se3(x).rotation),
    "matrix_to_rpy": (lambda x: spatial.matrix_to_rpy(se3(x).rotation), lambda x: pin.rpy.matrixToRpy(se3(x).rotation)),
    "rpy_to_quaternion": (
        lambda x: pin.Quaternion(*np.roll(spatial.rpy_to_quaternion(x[0]), 1)).matrix(),
        lambda x: se3(x).rotation,
    ),
    "turning": (lambda x: spatial.turning(x[0], x[1]), lambda x: rate_matrix(x) @ x[1]),
    "turning_rate": (lambda x: spatial.turning_rate(*x[:3]), lambda x: rate_matrix(x) @ x[2] + drift(x)),
    "rpy_rate": (lambda x: spatial.rpy_rate(se3(x).rotation, x[1]), lambda x: np.linalg.solve(rate_matrix(x), x[1])),
    "rpy_acceleration": (
        lambda x: spatial.rpy_acceleration(se3(x).rotation, x[1], x[2]),
        lambda x: np.linalg.solve(rate_matrix(x), x[2] - drift(x)),
    ),
    "integrate": (
        lambda x: filled(spatial.integrate, pin.SE3ToXYZQUAT(se3(x)), np.concatenate(x[2:]), FREE, shape=(7,)),
        moved,
    ),
    "difference": (
        lambda x: filled(spatial.difference, pin.SE3ToXYZQUAT(se3(x)), moved(x), FREE, shape=(6,)),
        lambda x: pin.difference(MODEL, pin.SE3ToXYZQUAT(se3(x)), moved(x)),
    ),
    "integrate, guided": (
        lambda x: filled(spatial.integrate, x[1][:1], x[2][:1], GUIDED, shape=(1,)),
        lambda x: x[1][:1] + x[2][:1],
    ),
    "difference, guided": (
        lambda x: filled(spatial.difference, x[1][:1], x[2][:1], GUIDED, shape=(1,)),
        lambda x: x[2][:1] - x[1][:1],
    ),
}


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-6])  # of turns: series and closed forms
@pytest.mark.parametrize("name", CASES)
def test_a_kernel_is_pinocchios_function(name: str, size: float) -> None:
    ours, theirs = CASES[name]
    for _ in range(20):
        x = RNG.uniform(-1.5, 1.5, 3), *RNG.uniform(-2.0, 2.0, (2, 3)), size * RNG.uniform(-1.5, 1.5, 3)
        # a quaternion to either side is the same turn; angles of 1.5 rad divide by a cosine of 0.07
        np.testing.assert_allclose(np.ravel(ours(x)), np.ravel(theirs(x)), atol=2e-12, err_msg=name)


@pytest.mark.parametrize(
    "turn", [0.0, 1e-9, 1e-4, 9.9e-3, 1.01e-2, 1.9e-2, 2.1e-2, 0.3, 2.0]
)  # about both series' ends
def test_a_step_of_the_pose_is_pinocchios_and_the_difference_undoes_it_to_rounding(turn: float) -> None:
    for _ in range(8):
        q = pin.SE3ToXYZQUAT(pin.SE3.Random())
        axis = RNG.standard_normal(3)
        dq = np.concatenate([RNG.uniform(-0.1, 0.1, 3), turn * axis / np.linalg.norm(axis)])
        after = filled(spatial.integrate, q, dq, FREE, shape=(7,))
        due = pin.integrate(MODEL, q, dq)
        np.testing.assert_allclose(after[:3], due[:3], atol=2e-15)
        same_sign = np.sign(after[3:] @ due[3:])  # q and -q are one rotation
        np.testing.assert_allclose(after[3:], same_sign * due[3:], atol=2e-15)
        assert np.linalg.norm(after[3:]) == pytest.approx(1.0, abs=1e-15)
        for sign in (1.0, -1.0):
            after[3:] *= sign
            np.testing.assert_allclose(filled(spatial.difference, q, after, FREE, shape=(6,)), dq, atol=4e-15)
        spatial.integrate(q, dq, FREE, q)  # it may write over its input
        after[3:] *= np.sign(after[3:] @ q[3:])
        np.testing.assert_array_equal(q, after)


def test_a_quaternion_stays_unit_however_many_steps_are_taken() -> None:
    q = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    for _ in range(20000):
        spatial.integrate(q, np.array([0.0, 0.0, 0.0, 1e-4, -2e-4, 3e-4]), FREE, q)
    # each step's rounding is corrected by the next: no growth with their number
    assert np.linalg.norm(q[3:]) == pytest.approx(1.0, abs=5e-16)


def test_every_kernel_has_its_oracle() -> None:
    assert {name.partition(",")[0] for name in CASES} == set(spatial.__all__)
