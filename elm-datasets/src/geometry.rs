//! Directions as vectors. The surface lies in the plane $z = 0$ with its normal along $+z$.

use std::f64::consts::PI;

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

/// Two unit vectors across the unit vector `n` and each other, which follow `n` smoothly on either side of
/// $z = 0$; right-handed with `n` as the third (T. Duff et al., *Building an Orthonormal Basis, Revisited*,
/// JCGT 6(1), 2017).
#[must_use]
pub fn tangents([x, y, z]: Vector) -> [Vector; 2] {
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [
        [1.0 + sign * x * x * a, sign * b, -sign * x],
        [b, sign + y * y * a, -y],
    ]
}

/// A pair of unit vectors in the frame of the surface: where light comes from and where it goes,
/// both pointing away from the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionPair {
    /// $\omega_i$, towards the light; the paper's $L$.
    pub incident: Vector,
    /// $\omega_o$, towards the viewer; the paper's $V$, at its angles $(\theta_e, \varphi_e)$.
    pub outgoing: Vector,
}

impl DirectionPair {
    /// The pair with light and viewer exchanged.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self {
            incident: self.outgoing,
            outgoing: self.incident,
        }
    }

    /// The pair turned about the normal by an angle in radians, from x towards y.
    #[must_use]
    pub fn turned(self, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        let turned = |[x, y, z]: Vector| [cos * x - sin * y, sin * x + cos * y, z];
        Self {
            incident: turned(self.incident),
            outgoing: turned(self.outgoing),
        }
    }

    /// Whether both directions lie above the surface: nothing is reflected otherwise.
    #[must_use]
    pub fn is_above_horizon(&self) -> bool {
        self.incident[2] > 0.0 && self.outgoing[2] > 0.0
    }

    /// Cosine of the angle between the light and the viewer, in \[-1, 1\].
    #[must_use]
    pub fn cos_between(&self) -> f64 {
        dot(self.incident, self.outgoing).clamp(-1.0, 1.0)
    }

    /// The pair as a file of angles gives it: unit vectors again, and the rounding of angles.
    #[must_use]
    pub(crate) fn through_angles(self) -> Self {
        let [incident, outgoing] = [self.incident, self.outgoing].map(|vector| {
            let (theta, phi) = polar(vector);
            cartesian(theta, phi)
        });
        Self { incident, outgoing }
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
/// use elm_datasets::geometry::{DirectionPair, cartesian};
/// let pair = DirectionPair { incident: cartesian(0.2, 0.0), outgoing: cartesian(1.0, 0.0) };
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

/// A pair of directions as files have them: polar angles in radians. `theta` is measured from the
/// surface normal, `phi` around it; `i` is the light, `o` the viewer.
///
/// ```
/// use elm_datasets::geometry::{Angles, DirectionPair};
/// use std::f64::consts::PI;
///
/// let mirror = DirectionPair::from(Angles { theta_i: 0.5, phi_i: 0.0, theta_o: 0.5, phi_o: PI });
/// assert!((mirror.cos_between() - 1.0_f64.cos()).abs() < 1e-15);
/// assert_eq!(Angles::of(&mirror).phi_o, PI);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Angles {
    /// Angle between the normal and the light.
    pub theta_i: f64,
    /// Azimuth of the light.
    pub phi_i: f64,
    /// Angle between the normal and the viewer.
    pub theta_o: f64,
    /// Azimuth of the viewer.
    pub phi_o: f64,
}

impl Angles {
    /// The angles of a pair, azimuths from -pi to pi: those that give the same vectors, bit for bit,
    /// where any angles do, and among them those with at most 15 digits. So a file that is read and
    /// written again keeps its numbers.
    #[must_use]
    pub fn of(pair: &DirectionPair) -> Self {
        let [(theta_i, phi_i), (theta_o, phi_o)] = [pair.incident, pair.outgoing].map(exact_polar);
        Self {
            theta_i,
            phi_i,
            theta_o,
            phi_o,
        }
    }

    /// The two polar angles and azimuths in the order of their names.
    pub(crate) fn to_array(self) -> [f64; 4] {
        [self.theta_i, self.phi_i, self.theta_o, self.phi_o]
    }
}

impl From<Angles> for DirectionPair {
    /// Equation 12 for both directions.
    fn from(angles: Angles) -> Self {
        Self {
            incident: cartesian(angles.theta_i, angles.phi_i),
            outgoing: cartesian(angles.theta_o, angles.phi_o),
        }
    }
}

/// As [`polar`], but of the angles near those computed such that [`cartesian`] gives the same bits,
/// where there are any.
fn exact_polar(vector: Vector) -> (f64, f64) {
    let (theta, phi) = polar(vector);
    let azimuths = || nearby(phi).filter(|phi| phi.abs() <= PI);
    let polar_angles = nearby(theta).filter(|theta| theta.cos() == vector[2]);
    polar_angles
        .flat_map(|theta| azimuths().map(move |phi| (theta, phi)))
        .find(|&(theta, phi)| cartesian(theta, phi) == vector)
        .unwrap_or((theta, phi))
}

/// A number to 15 digits, itself, and the five above and below.
fn nearby(number: f64) -> impl Iterator<Item = f64> {
    let rounded = format!("{number:.14e}").parse().ok();
    let above = std::iter::successors(Some(number), |number| Some(number.next_up()));
    let below = std::iter::successors(Some(number), |number| Some(number.next_down()));
    let both = above.zip(below).take(6).flat_map(|(a, b)| [a, b]);
    rounded.into_iter().chain(both)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_3, FRAC_PI_4};

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
        let pair = DirectionPair {
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
            let pair = DirectionPair {
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

    #[test]
    fn opposite_azimuths_add_the_polar_angles_and_equal_ones_subtract_them() {
        let between = |phi_o| {
            let pair = DirectionPair {
                incident: cartesian(0.3, 0.0),
                outgoing: cartesian(FRAC_PI_4, phi_o),
            };
            assert_eq!(pair.swapped().swapped(), pair);
            assert_eq!(pair.swapped().cos_between(), pair.cos_between());
            pair.cos_between().acos()
        };
        assert_relative_eq!(between(PI), FRAC_PI_4 + 0.3, epsilon = 1e-14);
        assert_relative_eq!(between(0.0), FRAC_PI_4 - 0.3, epsilon = 1e-14);
    }

    #[test]
    fn angles_with_few_digits_come_back_as_they_were() {
        for thousandths in 1..1570 {
            let theta = f64::from(thousandths) / 1000.0;
            for phi in [-3.1, -2.0, -0.1, 0.0, 0.7, 1.5, 3.0] {
                assert_eq!(exact_polar(cartesian(theta, phi)), (theta, phi));
            }
        }
        assert_eq!(exact_polar(NORMAL), (0.0, 0.0));
        assert_eq!(exact_polar([1.0, 0.0, 0.0]), (FRAC_PI_2, 0.0));
    }

    proptest! {
        #[test]
        fn angles_give_the_vectors_that_they_were_taken_from_bit_for_bit(
            theta in 0.0..=FRAC_PI_2, phi in -PI..=PI,
        ) {
            let vector = cartesian(theta, phi);
            let (theta, phi) = exact_polar(vector);
            prop_assert_eq!(cartesian(theta, phi), vector);
        }

        #[test]
        fn half_and_difference_angles_are_those_of_the_vectors_and_reciprocal(
            theta_i in 0.0..FRAC_PI_2, phi_i in -PI..PI,
            theta_o in 0.0..FRAC_PI_2, phi_o in -PI..PI,
        ) {
            let pair = DirectionPair {
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
