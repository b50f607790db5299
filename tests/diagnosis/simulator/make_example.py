"""Make `fixtures/simulators/pendulum.csv`: a pendulum with air drag, by a program that shares no code with the package.

`python -m tests.diagnosis.simulator.make_example`
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

INERTIA, WEIGHT, DAMPING, DRAG = 0.012, 1.0, 0.008, 0.0012
"""kg m², N m, N m s, N m s²."""

FILTER_S, NOISE, STEP_S, ROWS, SEED = 0.01, 0.002, 0.01, 400, 7


def recording(drag=DRAG, seed=SEED, rows=ROWS):
    """Times [s], torques [N m] and measured angles [rad]."""
    rng = np.random.default_rng(seed)
    t = STEP_S * np.arange(rows)
    held = np.repeat(rng.uniform(-0.35, 0.35, rows // 25 + 1), 25)[:rows]

    def rate(_t, state, torque):
        angle, speed, shown = state
        acceleration = (torque - WEIGHT * np.sin(angle) - DAMPING * speed - drag * speed * abs(speed)) / INERTIA
        return [speed, acceleration, (angle - shown) / FILTER_S]

    state, shown = np.zeros(3), [0.0]
    for k in range(rows - 1):
        state = solve_ivp(rate, (t[k], t[k + 1]), state, args=(held[k],), rtol=1e-9, atol=1e-11).y[:, -1]
        shown.append(state[2])
    return t, held, np.array(shown) + NOISE * rng.standard_normal(rows)


if __name__ == "__main__":
    lines = [
        "# pendulum with air drag, simulated: python -m tests.diagnosis.simulator.make_example",
        "t_s,motor_n_m,angle_rad",
    ]
    lines += [f"{t:.2f},{u:.4f},{angle:.5f}" for t, u, angle in zip(*recording(), strict=True)]
    Path("fixtures/simulators/pendulum.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
