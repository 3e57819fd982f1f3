//! Directions as vectors. The surface lies in the plane $z = 0$ with its normal along $+z$.

use elm_datasets::Directions;

/// A vector in the frame of the surface.
pub type Vector = [f64; 3];

/// The surface normal.
pub const NORMAL: Vector = [0.0, 0.0, 1.0];

/// Equation 12: the unit vector at angle `theta` from the normal and azimuth `phi`, in radians.
///
/// ```
/// use elm_brdf::geometry::{cartesian, dot, NORMAL};
/// let l = cartesian(60_f64.to_radians(), 0.0);
/// assert!((dot(l, NORMAL) - 0.5).abs() < 1e-15);
/// ```
#[must_use]
pub fn cartesian(theta: f64, phi: f64) -> Vector {
    let (sin_theta, cos_theta) = theta.sin_cos();
    let (sin_phi, cos_phi) = phi.sin_cos();
    [cos_phi * sin_theta, sin_phi * sin_theta, cos_theta]
}

/// Scalar product.
#[must_use]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Equation 3: $R = 2 (L \cdot N) N - L$, the direction `l` mirrored about the unit normal `n`.
#[must_use]
pub fn reflect(l: Vector, n: Vector) -> Vector {
    let twice = 2.0 * dot(l, n);
    [
        twice * n[0] - l[0],
        twice * n[1] - l[1],
        twice * n[2] - l[2],
    ]
}

/// Equation 5: the unit vector halfway between `l` and `v`, or `None` where they are opposite.
#[must_use]
pub fn half_vector(l: Vector, v: Vector) -> Option<Vector> {
    let sum = [l[0] + v[0], l[1] + v[1], l[2] + v[2]];
    let length = dot(sum, sum).sqrt();
    (length > 0.0).then(|| sum.map(|c| c / length))
}

/// A pair of unit vectors in the frame of the surface: where light comes from and where it goes,
/// both pointing away from the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// $\omega_i$, towards the light; the paper's $L$.
    pub incident: Vector,
    /// $\omega_o$, towards the viewer; the paper's $V$, at its angles $(\theta_e, \varphi_e)$.
    pub outgoing: Vector,
}

impl Pair {
    /// The pair with light and viewer exchanged.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self {
            incident: self.outgoing,
            outgoing: self.incident,
        }
    }
}

impl From<&Directions> for Pair {
    /// Equation 12 for both directions.
    fn from(directions: &Directions) -> Self {
        Self {
            incident: cartesian(directions.theta_i, directions.phi_i),
            outgoing: cartesian(directions.theta_o, directions.phi_o),
        }
    }
}

/// Every pair of directions as vectors.
#[must_use]
pub fn pairs(directions: &[Directions]) -> Vec<Pair> {
    directions.iter().map(Pair::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_3, FRAC_PI_4, PI};

    #[test]
    fn equation_12_at_hand_computed_angles() {
        let half_root_3 = 3.0_f64.sqrt() / 2.0;
        let table = [
            (0.0, 1.234, [0.0, 0.0, 1.0]),
            (FRAC_PI_2, 0.0, [1.0, 0.0, 0.0]),
            (FRAC_PI_2, FRAC_PI_2, [0.0, 1.0, 0.0]),
            (FRAC_PI_4, PI, [-FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2]),
            // sin 60 = root(3)/2, times cos 60 and sin 60 for the azimuth.
            (FRAC_PI_3, FRAC_PI_3, [half_root_3 / 2.0, 0.75, 0.5]),
        ];
        for (theta, phi, expected) in table {
            assert_abs_diff_eq!(&cartesian(theta, phi)[..], &expected[..], epsilon = 1e-15);
        }
    }

    #[test]
    fn equation_3_turns_the_azimuth_by_half_a_turn() {
        // About the normal, mirroring keeps theta and adds pi to phi.
        let r = reflect(cartesian(0.7, 0.3), NORMAL);
        assert_abs_diff_eq!(&r[..], &cartesian(0.7, 0.3 + PI)[..], epsilon = 1e-15);
    }

    #[test]
    fn equation_5_bisects_and_has_no_answer_for_opposite_vectors() {
        let h = half_vector(cartesian(0.2, 0.0), cartesian(1.0, 0.0)).unwrap();
        assert_abs_diff_eq!(&h[..], &cartesian(0.6, 0.0)[..], epsilon = 1e-15);
        assert_eq!(half_vector([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]), None);
    }

    proptest! {
        #[test]
        fn mirroring_is_an_involution_and_keeps_length_and_angle_to_the_normal(
            theta in 0.0..FRAC_PI_2, phi in -PI..PI,
        ) {
            let l = cartesian(theta, phi);
            let r = reflect(l, NORMAL);
            prop_assert!((dot(r, r) - 1.0).abs() < 1e-14);
            prop_assert!((dot(r, NORMAL) - dot(l, NORMAL)).abs() < 1e-15);
            let back = reflect(r, NORMAL);
            for axis in 0..3 {
                prop_assert!((back[axis] - l[axis]).abs() < 1e-15);
            }
        }
    }
}
