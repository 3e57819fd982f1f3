"""The paper's protocol in NumPy, written without a look at the Rust code, to check it against.

    python3 benches/peers/paper.py CURET_DIR

Prints, for eight seeds, the geometric mean over the paper's 15 materials of the held-out RMSE on
the average channel divided by the mean of the paper's three printed RMSEs.
"""

import sys

import numpy as np

# Table I: red, green, blue.
PRINTED = {
    1: (0.0416, 0.0323, 0.0131), 2: (0.0271, 0.0212, 0.0101), 9: (0.0692, 0.0458, 0.0214),
    12: (0.0344, 0.0225, 0.0099), 13: (0.0059, 0.0051, 0.0017), 15: (0.0702, 0.0490, 0.0230),
    16: (0.0173, 0.0174, 0.0068), 21: (0.0135, 0.01294, 0.0053), 23: (0.0316, 0.0228, 0.0113),
    25: (0.0309, 0.0301, 0.0141), 39: (0.0114, 0.0091, 0.0050), 41: (0.0485, 0.0378, 0.0173),
    44: (0.0298, 0.0206, 0.0080), 46: (0.0418, 0.0306, 0.0160), 55: (0.0483, 0.0425, 0.0260),
}


def cartesian(theta, phi):
    return np.stack(
        [np.cos(phi) * np.sin(theta), np.sin(phi) * np.sin(theta), np.cos(theta)], axis=1
    )


def load(folder):
    theta_v, phi_v, theta_i, phi_i = np.loadtxt(f"{folder}/table.txt")[:, 1:].T
    light, view = cartesian(theta_i, phi_i), cartesian(theta_v, phi_v)
    mirrored = light * [-1, -1, 1]
    inputs = np.stack(
        [light[:, 2], (view * mirrored).sum(1), np.cos(theta_i), np.sin(theta_i),
         np.cos(theta_v), np.sin(theta_v)],
        axis=1,
    )
    values = np.loadtxt(f"{folder}/abrdf.dat")
    return inputs, values[:, 0].astype(int), np.maximum(values[:, 1:], 0).T


def held_out(inputs, targets, neurons=50, folds=10, seed=0):
    random = np.random.default_rng(seed)
    fold = random.permutation(len(inputs)) % folds
    weights = random.uniform(-1, 1, (inputs.shape[1], neurons))
    biases = random.uniform(-1, 1, neurons)
    predicted = np.zeros_like(targets)
    for k in range(folds):
        train = fold != k
        mean, deviation = inputs[train].mean(0), inputs[train].std(0)
        hidden = 1 / (1 + np.exp(-((inputs - mean) / deviation @ weights + biases)))
        beta = np.linalg.pinv(hidden[train]) @ targets[train]
        predicted[~train] = hidden[~train] @ beta
    return predicted


def main():
    inputs, numbers, targets = load(sys.argv[1])
    for seed in range(8):
        rmse = np.sqrt(((held_out(inputs, targets, seed=seed) - targets) ** 2).mean(0))
        ratios = [rmse[numbers == m].item() / np.mean(p) for m, p in PRINTED.items()]
        print(f"seed {seed}: {np.exp(np.mean(np.log(ratios))):.2f}")


if __name__ == "__main__":
    main()
