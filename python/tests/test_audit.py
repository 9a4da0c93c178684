"""Audits against the closed loop, and against themselves with other executors."""

import concurrent.futures
import multiprocessing

import numpy as np
import pytest

import dashpot
from conftest import HOME, ROOT

GAINS = dict(task_stiffness=[200, 200, 200, 20, 20, 20], damping_factor=2.0)


def test_a_posture_has_the_modes_of_the_closed_loop(panda):
    found = dashpot.audit(panda, HOME, **GAINS, period=0.001, damping_ratio=0.7,
                          urdf_friction=True)
    loop = dashpot.closed_loop(panda, HOME, task_stiffness=GAINS["task_stiffness"],
                               task_damping=2 * np.sqrt(GAINS["task_stiffness"]))
    posture = found.posture
    np.testing.assert_allclose(posture.modes.natural_frequency, loop.modes.natural_frequency,
                               rtol=1e-9)
    firm = posture.modes.kind != "soft"
    assert posture.smallest_ratio == posture.modes.damping_ratio[firm].min()
    fastest = np.linalg.eigvals(np.block(
        [[np.zeros((7, 7)), np.eye(7)],
         [-np.linalg.solve(loop.mass, loop.stiffness), -np.linalg.solve(loop.mass, loop.damping)]]))
    assert posture.fastest_pole == pytest.approx(fastest.real.min(), rel=1e-9)
    assert 1 < posture.gain_margin < 1e6
    damped = dashpot.audit(panda, HOME, task_stiffness=GAINS["task_stiffness"],
                           task_damping=found.suggestion.damping).posture
    assert damped.smallest_ratio == pytest.approx(0.7, abs=0.01)
    assert found.workspace is None


@pytest.mark.parametrize("gains, question", [
    (dict(task_stiffness=[400] * 3 + [20] * 3, task_damping=[0.7] * 6), "is it a damping ratio"),
    (dict(task_stiffness=[20] * 3 + [400] * 3, task_damping=[9] * 6), "is the order another"),
    (dict(joint_stiffness=[600] * 7, joint_damping=[0.7] * 7), "joint damping: 0.7 is little")])
def test_doubtful_gains_are_asked_about(panda, gains, question):
    for call in (dashpot.audit, dashpot.closed_loop):
        with pytest.warns(UserWarning, match=question):
            call(panda, HOME, **gains)


@pytest.mark.parametrize("options, complaint", [
    (dict(period=1), "period: must be between 0 and 0.1 s; is it in ms"),
    (dict(period=0.001, delay=0.002), "delay: 0.002 is not a whole number of ticks; is it in s"),
    (dict(period=0.001, delay=np.inf), "delay: inf is not a whole"),
    (dict(period=0.001, delay=np.nan), "delay: nan is not a whole"),
    (dict(samples=9, lower=[-100] * 7, upper=[100] * 7), "lower and upper.0.: joint 'panda_joint1' at")])
def test_other_units_are_refused(panda, options, complaint):
    with pytest.raises(dashpot.Error, match=complaint):
        dashpot.audit(panda, **GAINS, **options)


def test_an_audit_prints_what_it_has_part_by_part(panda):
    lines = repr(dashpot.audit(panda, HOME, **GAINS, damping_ratio=0.7)).splitlines()
    assert lines[0] == "Audit" and "  workspace: None" in lines and "    modes: 6 modes" in lines
    assert max(map(len, lines)) < 120 and len(lines) < 25


def test_an_integral_counts_in_the_margin(panda):
    stiff = dict(task_stiffness=[150] * 3 + [250] * 3, damping_factor=2, inertia_blocks=True)
    plain = dashpot.audit(panda, HOME, **stiff, period=0.001).posture
    found = dashpot.audit(panda, HOME, **stiff, period=0.001, integral_time=2).posture
    assert len(plain.integral_decays) == 0 and len(found.integral_decays) == 6
    np.testing.assert_allclose(found.integral_decays, 0.5, atol=0.1)
    assert found.gain_margin == pytest.approx(plain.gain_margin, rel=0.02)
    quick = dashpot.audit(panda, HOME, **stiff, period=0.001, integral_time=0.8).posture
    assert plain.gain_margin > 1 and quick.gain_margin < 0.01
    assert found.smallest_ratio == plain.smallest_ratio
    with pytest.raises(dashpot.Error, match="integral_time"):
        dashpot.audit(panda, HOME, **stiff, period=0.001, integral_time=-1)


def test_a_kinematic_null_space_acts_through_the_pseudo_inverse(panda):
    for q in (HOME, [0.3, -0.4, 0.8, -1.9, 0.2, 2.1, -0.5]):
        M, J = panda.mass(q), panda.jacobian(q)
        N = np.eye(7) - np.linalg.pinv(J) @ J
        K_C = np.diag(GAINS["task_stiffness"])
        K = J.T @ K_C @ J + N.T @ (10.0 * N)
        C = J.T @ (2 * np.sqrt(K_C)) @ J + N.T @ (6.0 * N) + 0.003 * np.eye(7)  # the URDF's friction
        values = np.linalg.eigvals(np.block([[np.zeros((7, 7)), np.eye(7)],
                                             [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))
        swings = values[values.imag > 0]
        null_space = dict(null_stiffness=[10.0] * 7, null_damping=[6.0] * 7)
        found = dashpot.audit(panda, q, **GAINS, **null_space, null_projector="kinematic",
                              postures=[q], urdf_friction=True)
        for fastest, ratio in ((found.posture.fastest_pole, found.posture.smallest_ratio),
                               (found.workspace.fastest_pole.worst,
                                found.workspace.smallest_ratio.worst)):
            assert fastest == pytest.approx(values.real.min(), rel=1e-9)
            assert ratio == pytest.approx((-swings.real / abs(swings)).min(), abs=1e-9)
        damped = dict(task_stiffness=GAINS["task_stiffness"], task_damping=2 * np.sqrt(K_C))
        loop = dashpot.closed_loop(panda, q, **damped, **null_space, null_projector="kinematic")
        np.testing.assert_allclose(loop.stiffness, K, atol=1e-9 * abs(K).max())
        plain = dashpot.closed_loop(panda, q, **damped, **null_space)
        assert abs(plain.stiffness - K).max() > 0.1
        with pytest.raises(dashpot.Error, match="null_projector: 'both'"):
            dashpot.closed_loop(panda, q, **damped, null_projector="both")
        other = dashpot.audit(panda, q, **GAINS, **null_space).posture
        assert abs(other.fastest_pole / values.real.min() - 1) > 1e-3
        W = np.diag(np.linspace(0.3, 3, 7))
        V = np.linalg.inv(W)
        N = np.eye(7) - V @ J.T @ np.linalg.solve(J @ V @ J.T, J)
        weighted = dict(null_projector="weighted", null_weights=np.diag(W))
        loop = dashpot.closed_loop(panda, q, **damped, **null_space, **weighted)
        np.testing.assert_allclose(loop.stiffness, J.T @ K_C @ J + 10 * N.T @ N, atol=1e-9 * abs(K).max())
        stated = dashpot.audit(panda, q, **GAINS, **null_space, **weighted,
                               urdf_friction=True).posture.modes
        np.testing.assert_allclose(stated.natural_frequency, loop.modes.natural_frequency, rtol=1e-4)
        for wrong in (dict(weighted, null_weights=[0.0] * 7), dict(null_weights=[1.0] * 7)):
            with pytest.raises(dashpot.Error, match="null_weights"):
                dashpot.closed_loop(panda, q, **damped, **wrong)
        both = dashpot.closed_loop(panda, q, **damped, **null_space, null_projector="none")
        np.testing.assert_allclose(both.stiffness, J.T @ K_C @ J + 10 * np.eye(7), atol=1e-9 * abs(K).max())
        both = dashpot.closed_loop(panda, q, task_stiffness=GAINS["task_stiffness"], task_damping_ratio=0.6,
                                   null_stiffness=[10.0] * 7, null_damping_ratio=0.6, null_projector="none")
        np.testing.assert_allclose(both.modes.damping_ratio[both.modes.natural_frequency > 10], 0.6, atol=0.02)


def test_workspaces_are_the_same_with_any_executor(panda):
    spawn = multiprocessing.get_context("spawn")
    with (concurrent.futures.ThreadPoolExecutor(1) as one,
          concurrent.futures.ThreadPoolExecutor(5) as five,
          concurrent.futures.ProcessPoolExecutor(2, mp_context=spawn) as processes):
        found = [dashpot.audit(panda, **GAINS, samples=700, seed=3, executor=executor).workspace
                 for executor in (None, one, five, processes)]
    for other in found[1:]:
        for name in ("smallest_ratio", "fastest_pole", "gain_margin"):
            for field, value in vars(getattr(found[0], name)).items():
                np.testing.assert_array_equal(getattr(getattr(other, name), field), value)
    ratio = found[0].smallest_ratio
    assert found[0].samples == 700
    assert ratio.worst <= ratio.p05 <= ratio.median <= ratio.p95
    again = dashpot.audit(panda, ratio.worst_q, **GAINS).posture
    assert again.smallest_ratio == ratio.worst
    other = dashpot.audit(panda, **GAINS, samples=700, seed=4).workspace
    assert other.smallest_ratio.median != ratio.median


def test_postures_may_be_given(panda):
    rng = np.random.default_rng(5)
    postures = rng.uniform(panda.lower, panda.upper, (300, 7))
    found = dashpot.audit(panda, **GAINS, postures=postures).workspace
    ratios = [dashpot.audit(panda, q, **GAINS).posture.smallest_ratio for q in postures[:300:10]]
    assert found.samples == 300 and found.smallest_ratio.worst <= min(ratios)
    narrow = dict(lower=np.array(HOME) - 0.01, upper=np.array(HOME) + 0.01)
    near = dashpot.audit(panda, **GAINS, samples=100, **narrow).workspace.smallest_ratio
    assert np.all(np.abs(near.worst_q - HOME) <= 0.01) and near.p95 - near.worst < 0.05
    assert any(np.array_equal(found.smallest_ratio.worst_q, q) for q in postures)


def test_half_quaternions_halve_the_rotational_springs(panda):
    half = dashpot.audit(panda, HOME, task_stiffness=[200] * 3 + [20] * 3, task_damping=[30] * 6,
                         half_quaternion=True).posture
    whole = dashpot.audit(panda, HOME, task_stiffness=[200] * 3 + [10] * 3,
                          task_damping=[30] * 6).posture
    np.testing.assert_allclose(half.modes.eigenvalues, whole.modes.eigenvalues, rtol=1e-12)


def test_friction_of_the_urdf_counts_where_it_is_asked_for(panda):
    plain, asked = (dashpot.audit(panda, HOME, **GAINS, urdf_friction=counts).posture.smallest_ratio
                    for counts in (False, True))
    assert plain < asked < 1.01 * plain  # 0.003 N m s/rad
    urdf, base, tip, file, options = panda._arguments
    stated = dashpot.Robot(urdf, base, tip, file=file,
                           **{**options, "viscous_friction": np.full(7, 1.0)})
    assert dashpot.audit(stated, HOME, **GAINS).posture.smallest_ratio > 1.05 * plain


def test_postures_outside_the_limits_are_refused_unless_asked_for(panda):
    degrees = [0, -45, 0, -135, 0, 90, 45]
    with pytest.raises(dashpot.Error, match="q: joint 'panda_joint2' at -45 rad is outside.*degrees"):
        dashpot.audit(panda, degrees, **GAINS)
    with pytest.raises(dashpot.Error, match=r"postures\[1\]: joint 'panda_joint2'"):
        dashpot.audit(panda, postures=[HOME, degrees], **GAINS)
    assert dashpot.audit(panda, degrees, **GAINS, outside_limits=True).posture is not None
    middle = dashpot.audit(panda, **GAINS).posture.q
    np.testing.assert_allclose(middle, (panda.lower + panda.upper) / 2)


@pytest.mark.parametrize("given, message", [
    (dict(task_stiffness=np.eye(5)), "gains.task.stiffness: is 5 x 5; 6 x 6"),
    (dict(task_stiffness=[-1, 0, 0, 0, 0, 0]), "task_stiffness: is not positive semidefinite"),
    (dict(damping_factor=2.0), "damping_factor"),
    (dict(task_stiffness=[1] * 6, joint_stiffness=[1] * 7), "not both"),
    (dict(task_stiffness=[1] * 6, damping_ratio=0.7), "damping_ratio: .*q is missing"),
    (dict(task_stiffness=[1] * 6, postures=[[1, 2]]), "postures: has 2 entries"),
    (dict(task_stiffness=[1] * 6, q=[1, 2]), "q: has 2 entries"),
    (dict(task_stiffness=[1] * 6, null_projector="both"), "null_projector: 'both'"),
])
def test_bad_input_gives_the_programs_messages(panda, given, message):
    with pytest.raises(dashpot.Error, match=message):
        dashpot.audit(panda, **given)


def test_unknown_rotors_are_said_to_be_so_with_what_would_be_enough(root, panda, tmp_path):
    gains = {"task_stiffness": [500] * 3 + [30] * 3, "damping_factor": 2, "period": 1e-3, "delay": 1}
    posture = dashpot.audit(panda, HOME, **gains).posture
    assert posture.rotors == "unknown" and posture.gain_margin < 1
    assert panda.missing_rotors == "the model has no reflected inertia of any joint"
    enough = posture.reflected_inertia_for_margin
    assert (enough >= 0).all() and (enough[:3] == 0).all() and enough[6] > 0
    assert posture.damping_ratios_with_rotors.shape == posture.modes.damping_ratio.shape
    model = (root / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp")
    known = dashpot.Robot.from_urdf(*model, reflected_inertia=enough + 1e-6)
    assert dashpot.audit(known, HOME, **gains).posture.gain_margin >= 2
    more = dashpot.audit(panda, HOME, margin=4, **gains).posture.reflected_inertia_for_margin
    assert more[6] > enough[6]
    drives = dashpot.published_drives()["panda"]
    assert drives["source"] and drives["doubt"]
    named = dashpot.Robot.from_urdf(*model, drives="panda")
    assert (named.reflected_inertia == drives["reflected_inertia"]).all()
    assert (named.viscous_friction == panda.viscous_friction).all()
    file = tmp_path / "drives.yaml"
    file.write_text("reflected_inertia: [1, 1, 1, 1, 1, 1, 1]\nviscous_friction: 3 N m s/rad\n")
    assert dashpot.Robot.from_urdf(*model, drives=str(file)).viscous_friction.max() == 3
    assert dashpot.Robot.from_urdf(*model, drives=str(file),
                                   drives_friction=False).viscous_friction.max() < 3
    rubs = dashpot.Robot.from_urdf(*model, drives="panda", drives_friction=True)
    assert (rubs.viscous_friction == drives["viscous_friction"]).all()
    found = dashpot.audit(named, HOME, **gains).posture
    assert found.rotors == "known" and found.reflected_inertia_for_margin is None
    # Beside the modes without rotors, whose order is another.
    np.testing.assert_allclose(
        np.sort(posture.damping_ratios_with_rotors), np.sort(found.modes.damping_ratio), rtol=1e-9
    )
    with pytest.raises(dashpot.Error, match="drives: 'pandas' is not one of panda, fr3"):
        dashpot.Robot.from_urdf(*model, drives="pandas")


def test_contact_turns_where_the_curve_crosses_zero():
    panda = dashpot.Robot.from_urdf(ROOT / "sim/models/panda.urdf", "panda_link0", "panda_hand_tcp", drives="panda")
    stated = dict(**GAINS, delay=1, ideal_gravity=True)
    least = dashpot.contact(panda, HOME, **stated)
    assert least.limit_lower < least.limit < least.limit_upper and not least.passive
    assert dashpot.contact(panda, HOME, direction=[0, 0, 1], **stated).limit > least.limit
    both = dashpot.contact(panda, HOME, direction=3 * least.direction, **stated,
                           stiffness=[0.99 * least.limit, 1.01 * least.limit])
    assert both.limit == pytest.approx(least.limit, rel=1e-8)
    assert both.curve[0, 1] > 0 > both.curve[1, 1]
    assert both.curve[1, 2] == pytest.approx(both.frequency, rel=0.01)
    assert least.forces.shape == (8, 6) and (np.abs(least.weight) < least.effort).all()


@pytest.mark.parametrize("options, complaint", [
    (dict(direction=[0, 0, 0]), "direction: has to be finite and not zero"),
    (dict(direction=[0, 1]), "direction: has 2 entries, expected 3"),
    (dict(damper=-1), "damper: must be finite and not negative"),
    (dict(mass=-1), "mass: must be finite and not negative")])
def test_what_is_no_touch_is_refused(panda, options, complaint):
    with pytest.raises(dashpot.Error, match=complaint):
        dashpot.contact(panda, HOME, **GAINS, **options)
