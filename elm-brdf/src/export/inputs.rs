//! The networks' inputs in the common notation: numbers made of the components of both directions.

use super::error::ExportError;

/// The expression of an input, by its name in [`Features`](crate::features::Features), made of the
/// [`LOCALS`].
pub(super) fn expression(name: &str) -> Result<&'static str, ExportError> {
    INPUTS
        .iter()
        .find(|(input, _)| *input == name)
        .map(|(_, expression)| *expression)
        .ok_or_else(|| ExportError::Input {
            name: name.to_owned(),
        })
}

const INPUTS: &[(&str, &str)] = &[
    ("L.N", "iz"),
    // V . R with R = (-ix, -iy, iz).
    ("V.R", "oz * iz - ox * ix - oy * iy"),
    ("cos theta_i", "iz"),
    ("sin theta_i", "sqrt(ix * ix + iy * iy)"),
    ("cos theta_o", "oz"),
    ("cos theta_e", "oz"),
    ("sin theta_e", "sqrt(ox * ox + oy * oy)"),
    ("theta_h", "theta_h"),
    ("sqrt theta_h", "sqrt(theta_h)"),
    (
        "sqrt theta_h cos 2 phi_h",
        "sqrt(theta_h) * (sx * sx - sy * sy) / max(across * across, 1e-30)",
    ),
    (
        "sqrt theta_h sin 2 phi_h",
        "sqrt(theta_h) * 2.0 * sx * sy / max(across * across, 1e-30)",
    ),
    ("sqrt sin theta_h", "sqrt(across / sum)"),
    ("cos theta_h", "sz / sum"),
    ("theta_d", "theta_d"),
    (
        "cos theta_d",
        "sum / sqrt(sum * sum + difference * difference)",
    ),
    (
        "cos^2 theta_d",
        "sum * sum / (sum * sum + difference * difference)",
    ),
    ("cos theta_i + cos theta_o", "sz"),
    ("cos theta_o - cos theta_i", "oz - iz"),
    ("cos theta_i cos theta_o", "iz * oz"),
    ("sin theta_i sin theta_o cos dphi", "ix * ox + iy * oy"),
];

/// Values that inputs are made of, each of the components (`ix` to `iz`, `ox` to `oz`) and of
/// those before it. `ANGLE(y, x)` stands for [`ANGLE`].
pub(super) const LOCALS: &[(&str, &str)] = &[
    ("sx", "ix + ox"),
    ("sy", "iy + oy"),
    ("sz", "iz + oz"),
    ("dx", "ix - ox"),
    ("dy", "iy - oy"),
    ("dz", "iz - oz"),
    ("across", "sqrt(sx * sx + sy * sy)"),
    ("sum", "sqrt(sx * sx + sy * sy + sz * sz)"),
    ("difference", "sqrt(dx * dx + dy * dy + dz * dz)"),
    ("theta_h", "ANGLE(across, sz)"),
    ("theta_d", "ANGLE(difference, sum)"),
];

/// The arc tangent of y / x where neither is negative and one is not 0: Abramowitz and Stegun,
/// *Handbook of Mathematical Functions*, 4.4.49, with an error of 2e-8.
pub(super) const ANGLE: &[(&str, &str)] = &[
    ("t", "min(x, y) / max(x, y)"),
    ("s", "t * t"),
    (
        "a",
        "t * (1.0 + s * (-0.3333314528 + s * (0.1999355085 + s * (-0.1420889944 \
         + s * (0.1065626393 + s * (-0.0752896400 + s * (0.0429096138 \
         + s * (-0.0161657367 + s * 0.0028662257))))))))",
    ),
    ("swap", "0.5 + 0.5 * sign(y - x)"),
];
/// What [`ANGLE`] comes to.
pub(super) const ANGLE_RESULT: &str = "a + swap * (1.57079633 - 2.0 * a)";

/// Of `definitions`, those that `uses` need, in order.
pub(super) fn needed<'a>(
    definitions: &'a [(&'a str, &'a str)],
    uses: &[&str],
) -> Vec<(&'a str, &'a str)> {
    let mut needed: Vec<(&str, &str)> = Vec::new();
    for &(name, expression) in definitions.iter().rev() {
        let mut users = uses.iter().chain(needed.iter().map(|(_, e)| e));
        if users.any(|user| words(user).any(|word| word == name)) {
            needed.push((name, expression));
        }
    }
    needed.reverse();
    needed
}

/// The names in an expression.
fn words(expression: &str) -> impl Iterator<Item = &str> {
    expression.split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
}
