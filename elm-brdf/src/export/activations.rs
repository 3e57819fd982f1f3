//! The neurons' functions in a common notation that [`Dialect`](super::dialect) puts into each
//! language: lines of `name = expression`, and the result. `z` and all names are vectors of four
//! in shaders and numbers in C.

use super::error::ExportError;

/// A function of one argument `z`.
pub(super) struct Function {
    pub(super) name: &'static str,
    /// Intermediate values in order.
    pub(super) lines: &'static [(&'static str, &'static str)],
    pub(super) result: &'static str,
}

/// The source of the activation of this name.
///
/// Errors are absolute: output weights multiply values, not their relative errors.
pub(super) fn function(name: &str) -> Result<&'static Function, ExportError> {
    FUNCTIONS
        .iter()
        .find(|function| function.name == name)
        .ok_or_else(|| ExportError::Activation {
            name: name.to_owned(),
        })
}

/// Names are those of [`elm::Activation::name`], with `_` for `-` in functions.
const FUNCTIONS: &[Function] = &[
    Function {
        name: "sigmoid",
        // exp of what is not positive cannot overflow.
        lines: &[("e", "exp(-abs(z))")],
        result: "0.5 + 0.5 * sign(z) * (1.0 - e) / (1.0 + e)",
    },
    Function {
        name: "tanh",
        lines: &[("e", "exp(-2.0 * abs(z))")],
        result: "sign(z) * (1.0 - e) / (1.0 + e)",
    },
    Function {
        name: "sine",
        // z = n pi + r with |r| <= pi/2, pi in two parts; then the Taylor series of the sine, whose
        // first missing term is (pi/2)^13 / 13! = 6e-8; n's parity gives the sign.
        lines: &[
            ("n", "floor(0.318309886 * z + 0.5)"),
            ("r", "(z - 3.140625 * n) - 9.67653589793e-4 * n"),
            ("s", "r * r"),
            ("parity", "n - 2.0 * floor(0.5 * n)"),
            (
                "series",
                "1.0 + s * (-1.66666667e-1 + s * (8.33333333e-3 + s * (-1.98412698e-4 \
                 + s * (2.75573192e-6 - s * 2.50521084e-8))))",
            ),
        ],
        result: "(1.0 - 2.0 * parity) * r * series",
    },
    Function {
        name: "gaussian",
        lines: &[],
        result: "exp(-z * z)",
    },
    Function {
        name: "relu",
        lines: &[],
        result: "0.5 * (z + abs(z))",
    },
    Function {
        name: "squared-relu",
        lines: &[("r", "0.5 * (z + abs(z))")],
        result: "r * r",
    },
    Function {
        name: "hard-limit",
        // The inner sign is 0 at 0, where the function is 1.
        lines: &[],
        result: "0.5 + 0.5 * sign(sign(z) + 0.5)",
    },
    Function {
        name: "isru",
        lines: &[],
        result: "z / sqrt(1.0 + z * z)",
    },
    Function {
        name: "linear",
        // Of a distance; linear neurons of a sum fold into the output.
        lines: &[],
        result: "z",
    },
];
