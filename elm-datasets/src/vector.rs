//! Directions as vectors: the surface lies in the plane z = 0 with its normal along +z.

use crate::Directions;

pub(crate) type Vector = [f64; 3];

pub(crate) fn cartesian(theta: f64, phi: f64) -> Vector {
    let (sin_theta, cos_theta) = theta.sin_cos();
    let (sin_phi, cos_phi) = phi.sin_cos();
    [sin_theta * cos_phi, sin_theta * sin_phi, cos_theta]
}

/// Polar angle and azimuth of a vector of any length but zero; as precise near the normal, where
/// the arc cosine is not, as elsewhere.
pub(crate) fn polar([x, y, z]: Vector) -> (f64, f64) {
    (x.hypot(y).atan2(z), y.atan2(x))
}

/// Light and viewer.
pub(crate) fn pair(directions: &Directions) -> (Vector, Vector) {
    (
        cartesian(directions.theta_i, directions.phi_i),
        cartesian(directions.theta_o, directions.phi_o),
    )
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

/// The unit vector halfway between two, or `None` where they are opposite.
pub(crate) fn half(a: Vector, b: Vector) -> Option<Vector> {
    let sum = [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    let length = dot(sum, sum).sqrt();
    (length > 0.0).then(|| sum.map(|part| part / length))
}

/// `a` mirrored about the unit vector `axis`.
pub(crate) fn mirror(a: Vector, axis: Vector) -> Vector {
    let twice = 2.0 * dot(a, axis);
    std::array::from_fn(|part| twice * axis[part] - a[part])
}
