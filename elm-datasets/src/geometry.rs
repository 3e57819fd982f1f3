//! Directions as vectors. The surface lies in the plane $z = 0$ with its normal along $+z$.

use crate::samples::Directions;

/// A vector in the frame of the surface.
pub type Vector = [f64; 3];

/// The surface normal.
pub const NORMAL: Vector = [0.0, 0.0, 1.0];

/// Equation 12: the unit vector at angle `theta` from the normal and azimuth `phi`, in radians.
///
/// ```
/// use elm_datasets::geometry::{cartesian, dot, NORMAL};
/// let l = cartesian(60_f64.to_radians(), 0.0);
/// assert!((dot(l, NORMAL) - 0.5).abs() < 1e-15);
/// ```
#[must_use]
pub fn cartesian(theta: f64, phi: f64) -> Vector {
    let (sin_theta, cos_theta) = theta.sin_cos();
    let (sin_phi, cos_phi) = phi.sin_cos();
    [cos_phi * sin_theta, sin_phi * sin_theta, cos_theta]
}

/// Polar angle and azimuth of a vector of any length but zero; as precise near the normal, where the arc
/// cosine is not, as elsewhere.
#[must_use]
pub fn polar([x, y, z]: Vector) -> (f64, f64) {
    (x.hypot(y).atan2(z), y.atan2(x))
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

    /// Whether both directions lie above the surface: nothing is reflected otherwise.
    #[must_use]
    pub fn is_above_horizon(&self) -> bool {
        self.incident[2] > 0.0 && self.outgoing[2] > 0.0
    }

    /// The half and difference angles.
    #[must_use]
    pub fn half_difference(&self) -> HalfDifference {
        let (l, v) = (self.incident, self.outgoing);
        let sum = [l[0] + v[0], l[1] + v[1], l[2] + v[2]];
        let difference = [l[0] - v[0], l[1] - v[1], l[2] - v[2]];
        HalfDifference {
            along: sum[2],
            across: sum[0].hypot(sum[1]),
            sum: dot(sum, sum).sqrt(),
            difference: dot(difference, difference).sqrt(),
        }
    }
}

/// The angles of S. Rusinkiewicz, *A New Change of Variables for Efficient BRDF Representation*,
/// EGWR 1998: $\theta_h$ between the normal and the half vector, $\theta_d$ between the light and
/// the half vector, which is half the angle between light and viewer.
///
/// Computed from the lengths of $\omega_i + \omega_o$ and $\omega_i - \omega_o$, which are
/// $2 \cos\theta_d$ and $2 \sin\theta_d$, so that both angles keep their digits where light,
/// viewer, mirror direction or normal coincide (an arc cosine loses half of them there). Exchanging
/// light and viewer changes no bit. Where the two are opposite there is no half vector, and
/// $\theta_h$ is taken as 0.
///
/// ```
/// use elm_datasets::geometry::{Pair, cartesian};
/// let pair = Pair { incident: cartesian(0.2, 0.0), outgoing: cartesian(1.0, 0.0) };
/// let angles = pair.half_difference();
/// assert!((angles.theta_h() - 0.6).abs() < 1e-15);
/// assert!((angles.theta_d() - 0.4).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfDifference {
    /// Component of $\omega_i + \omega_o$ along the normal.
    along: f64,
    /// Length of its part in the plane of the surface.
    across: f64,
    /// $|\omega_i + \omega_o|$.
    sum: f64,
    /// $|\omega_i - \omega_o|$.
    difference: f64,
}

impl HalfDifference {
    /// $\theta_h$ in radians, at most $\pi/2$ for directions above the surface.
    #[must_use]
    pub fn theta_h(&self) -> f64 {
        self.across.atan2(self.along)
    }

    /// $\theta_d$ in radians, 0 to $\pi/2$.
    #[must_use]
    pub fn theta_d(&self) -> f64 {
        self.difference.atan2(self.sum)
    }

    /// $\cos\theta_h$.
    #[must_use]
    pub fn cos_theta_h(&self) -> f64 {
        if self.sum > 0.0 {
            self.along / self.sum
        } else {
            1.0
        }
    }

    /// $\sin\theta_h$.
    #[must_use]
    pub fn sin_theta_h(&self) -> f64 {
        if self.sum > 0.0 {
            self.across / self.sum
        } else {
            0.0
        }
    }

    /// $\cos\theta_d$.
    #[must_use]
    pub fn cos_theta_d(&self) -> f64 {
        self.sum / self.sum.hypot(self.difference)
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

impl From<&Pair> for Directions {
    fn from(pair: &Pair) -> Self {
        let ((theta_i, phi_i), (theta_o, phi_o)) = (polar(pair.incident), polar(pair.outgoing));
        Self {
            theta_i,
            phi_i,
            theta_o,
            phi_o,
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
    use approx::{assert_abs_diff_eq, assert_relative_eq};
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

    #[test]
    fn half_and_difference_angles_keep_their_digits_near_coincidence() {
        // In one plane theta_h is the mean of the two angles and theta_d half their difference;
        // an arc cosine would return 0 for both.
        let pair = Pair {
            incident: cartesian(3e-9, 0.0),
            outgoing: cartesian(1e-9, 0.0),
        };
        let angles = pair.half_difference();
        assert_relative_eq!(angles.theta_h(), 2e-9, max_relative = 1e-14);
        assert_relative_eq!(angles.theta_d(), 1e-9, max_relative = 1e-14);
    }

    #[test]
    fn grazing_and_opposite_directions_have_finite_angles() {
        // Light and viewer at the horizon on opposite sides: the half vector is the normal where
        // it exists. The heights are exact, the rounding of the horizontal parts cancels.
        for height in [1e-3, 1e-9, 1e-300, 0.0] {
            let pair = Pair {
                incident: [1.0, 0.0, height],
                outgoing: [-1.0, 0.0, height],
            };
            let angles = pair.half_difference();
            assert_eq!(angles.theta_h(), 0.0);
            assert_eq!(angles.cos_theta_h(), 1.0);
            assert_relative_eq!(angles.theta_d(), FRAC_PI_2 - height, epsilon = 1e-9);
            assert_relative_eq!(angles.cos_theta_d(), height, max_relative = 1e-6);
        }
    }

    proptest! {
        #[test]
        fn half_and_difference_angles_are_those_of_the_vectors_and_reciprocal(
            theta_i in 0.0..FRAC_PI_2, phi_i in -PI..PI,
            theta_o in 0.0..FRAC_PI_2, phi_o in -PI..PI,
        ) {
            let pair = Pair {
                incident: cartesian(theta_i, phi_i),
                outgoing: cartesian(theta_o, phi_o),
            };
            let angles = pair.half_difference();
            let h = half_vector(pair.incident, pair.outgoing).unwrap();
            // Each component of the sum carries a rounding of 1e-16, which its division by
            // |omega_i + omega_o| = 2 cos(theta_d) magnifies.
            let tolerance = 4e-16 / angles.cos_theta_d();
            prop_assert!((angles.theta_h().cos() - dot(h, NORMAL)).abs() <= tolerance);
            prop_assert!((angles.cos_theta_h() - dot(h, NORMAL)).abs() <= tolerance);
            prop_assert!((angles.theta_d().cos() - dot(h, pair.incident)).abs() <= tolerance);
            prop_assert!((angles.cos_theta_d() - dot(h, pair.incident)).abs() <= tolerance);
            prop_assert_eq!(pair.swapped().half_difference(), angles);
        }

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
