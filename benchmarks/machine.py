"""How far from the machine's limit: operations and bytes of a Kalman step by formula, beside what one core can do.

Peaks are measured on the same core: a product of two matrices of 1000 by 1000 by the BLAS that NumPy brings, and
a + s b on arrays far larger than the caches. Counted are prediction and update at n = 6 and k = 3, a multiplication, an
addition, a division and a root as one operation each.

    python benchmarks/machine.py [--quick] [--docs]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

import numpy as np
from filters import problem
from radar_problem import polar, polar_jacobian

from relnav_sim import kernels

n, k = 6, 3
RUNS = 50 if bench.QUICK else 200


def triangle(size):
    return size * (size + 1) // 2


def prediction_operations():
    """Return the operations of F P F^T + Q: the product F P, then one triangle of the sum."""
    return n * n * (2 * n - 1) + triangle(n) * 2 * n


def update_operations():
    """Return the operations of the update by a factor S = L L^T, as in relnav_sim/kernels/kalman.py."""
    products = k * n * (2 * n - 1) + k * k * (2 * n - 1) + k * k  # H P, H P H^T + R
    factor = sum(1 + (k - 1 - j) + 2 * triangle(k - 1 - j) for j in range(k))  # a root, a column, what is left
    solves = (n + 1) * k * k  # L^-1 H P and L^-1 nu: k (k - 1) / 2 products and sums, k divisions each
    moves = 2 * n * k + triangle(n) * 2 * k  # mean, and one triangle of P - W^T W
    score = 2 * k + 2 * k + 3  # NIS, and the logarithms
    return products + factor + solves + moves + score


def moved_bytes():
    """Return the bytes that a step reads and writes for a run.

    Means, covariances, residual, Jacobian, NIS, likelihood; F, Q and R are shared.
    """
    prediction = 2 * n * n
    update = 2 * (n + n * n) + k + k * n + 3
    return 8 * (prediction + update)


def main():
    bench.keep_to_one_core()
    given = problem(RUNS, 1)
    rng = np.random.default_rng(0)
    P = np.ascontiguousarray(np.broadcast_to(given.cov0, (RUNS, n, n)))
    m, nu = given.mean0, given.z[:, 0] - polar(given.mean0)
    H, R = polar_jacobian(m), given.R[None]
    F, Q = np.ascontiguousarray(given.F)[None], np.ascontiguousarray(given.Q)[None]
    repeats = 20 if bench.QUICK else 200

    def predict():
        for _ in range(repeats):
            kernels.kalman.predict(P, F, Q)

    def update():
        for _ in range(repeats):
            kernels.kalman.update(m, P, nu, H, R)

    size = 300 if bench.QUICK else 1000
    A, B, C = (rng.standard_normal((size, size)) for _ in range(3))
    long = 100_000 if bench.QUICK else 20_000_000
    a, b = rng.standard_normal(long), rng.standard_normal(long)

    def stream():
        np.multiply(b, 3.0, out=a)

    timings = bench.take_turns(
        {
            "product": bench.Contender(lambda: np.matmul(A, B, out=C), 1),
            "stream": bench.Contender(stream, 1),
            "predict": bench.Contender(predict, repeats * RUNS),
            "update": bench.Contender(update, repeats * RUNS),
        }
    )
    peak = 2 * size**3 / timings["product"].us / 1e3  # Gflop/s
    bandwidth = 16 * long / timings["stream"].us / 1e3  # GB/s: one array read, one written
    rows = []
    for name, operations in (("predict", prediction_operations()), ("update", update_operations())):
        rate = operations / timings[name].us / 1e3
        rows.append(
            f"| `kalman.{name}` | {operations} | {timings[name].us:.3f} | {rate:.1f} | {100 * rate / peak:.0f} % |"
        )
    both = timings["predict"].us + timings["update"].us
    operations = prediction_operations() + update_operations()
    rate = operations / both / 1e3
    rows.append(f"| both | {operations} | {both:.3f} | {rate:.1f} | {100 * rate / peak:.0f} % |")
    header = ["kernel", "operations a run", "us a run", "Gflop/s", "of the peak"]
    at_least = moved_bytes() / bandwidth / 1e3
    text = (
        f"{bench.table(header, rows)}\n\n"
        f"The peak is {peak:.0f} Gflop/s, the memory's bandwidth {bandwidth:.0f} GB/s, both of one core. A step reads "
        f"and writes {moved_bytes()} bytes a run, which from memory would take {at_least:.3f} us, "
        f"{100 * at_least / both:.0f} % of the time; {RUNS} runs stay in the caches."
    )
    bench.publish("machine", text)


if __name__ == "__main__":
    main()
