//! Directions as vectors: the surface lies in the plane z = 0 with its normal along +z.

use crate::Directions;

pub(crate) type Vector = [f64; 3];

/// Polar angle and azimuth of a vector of any length but zero; as precise near the normal, where
/// the arc cosine is not, as elsewhere.
pub(crate) fn polar([x, y, z]: Vector) -> (f64, f64) {
    (x.hypot(y).atan2(z), y.atan2(x))
}

pub(crate) fn directions(light: Vector, viewer: Vector) -> Directions {
    let ((theta_i, phi_i), (theta_o, phi_o)) = (polar(light), polar(viewer));
    Directions {
        theta_i,
        phi_i,
        theta_o,
        phi_o,
    }
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
