//! The orthogonal basis that CUReT itself represents its materials by.

use elm_datasets::brdf::EvalError;
use std::f64::consts::PI;

use elm::solve::{LeastSquares, Solver};
use ndarray::{Array2, ArrayView2, ArrayViewMut2};

use crate::error::Result;
use crate::fit::{Fit, Model, assign, check};
use elm_datasets::Brdf;
use elm_datasets::brdf::check_directions;
use elm_datasets::geometry::DirectionPair;

/// A linear combination of the isotropic and reciprocal functions that Zernike's polynomials
/// $R_n^l$ give on pairs of hemispheres,
///
/// $$ S_{nm}^l = \left[ \Theta_n^l(\theta_i) \Theta_m^l(\theta_o) + \Theta_m^l(\theta_i)
/// \Theta_n^l(\theta_o) \right] \cos l (\varphi_i - \varphi_o), \quad \Theta_n^l(\theta) =
/// \sqrt{\frac{n + 1}{2 \pi}} R_n^l(\sqrt 2 \sin \tfrac{\theta}{2}) $$
///
/// for $0 \le l \le m \le n \le$ `order`, $n - l$ and $m - l$ even: 5 coefficients for order 2, 55
/// for order 8. Predictions are bounded below by 0, which the combination is not.
///
/// J. Koenderink, A. van Doorn, M. Stavridi, *Bidirectional Reflection Distribution Function
/// Expressed in Terms of Surface Scattering Modes*, ECCV 1996.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Koenderink {
    /// The highest order of a polynomial.
    pub order: usize,
    /// How the coefficients are found.
    pub solver: Solver,
}

/// A [`Koenderink`] basis with the coefficients found for each channel.
pub struct KoenderinkModel {
    modes: Modes,
    /// Shape (modes, channels).
    coefficients: Array2<f64>,
}

/// The modes up to an order.
struct Modes {
    order: usize,
    /// $n, m, l$.
    indices: Vec<[usize; 3]>,
}

impl Modes {
    fn new(order: usize) -> Self {
        let mut indices = Vec::new();
        for n in 0..=order {
            for m in 0..=n {
                for l in (0..=m).filter(|l| (n - l) % 2 == 0 && (m - l) % 2 == 0) {
                    indices.push([n, m, l]);
                }
            }
        }
        Self { order, indices }
    }

    /// The modes' values, shape (pairs, modes); 0 below the horizon.
    fn design(&self, pairs: &[DirectionPair]) -> Array2<f64> {
        let mut design = Array2::zeros((pairs.len(), self.indices.len()));
        for (mut row, pair) in design.rows_mut().into_iter().zip(pairs) {
            if !pair.is_above_horizon() {
                continue;
            }
            let (l, v) = (pair.incident, pair.outgoing);
            // 2 sin^2(theta/2) = 1 - cos(theta), without cancellation near the normal.
            let squared = |w: [f64; 3]| (w[0] * w[0] + w[1] * w[1]) / (1.0 + w[2]);
            let incident = self.polynomials(squared(l));
            let outgoing = self.polynomials(squared(v));
            let azimuth = (l[0] * v[1] - l[1] * v[0]).atan2(l[0] * v[0] + l[1] * v[1]);
            for (value, &[n, m, l]) in row.iter_mut().zip(&self.indices) {
                let both =
                    incident[[n, l]] * outgoing[[m, l]] + incident[[m, l]] * outgoing[[n, l]];
                *value = both * (l as f64 * azimuth).cos();
            }
        }
        design
    }

    /// $\Theta_n^l$ at $n, l$, for the squared radius $\rho^2$.
    fn polynomials(&self, squared: f64) -> Array2<f64> {
        let mut out = Array2::zeros((self.order + 1, self.order + 1));
        let radius = squared.sqrt();
        for l in 0..=self.order {
            // R_n^l = rho^l P_k^(0, l)(2 rho^2 - 1) with k = (n - l) / 2: Jacobi's polynomials by
            // their recurrence, which keeps the digits that the explicit sum loses.
            let x = 2.0 * squared - 1.0;
            let b = l as f64;
            let (mut before, mut now) = (0.0, 1.0);
            let mut k = 0.0;
            for n in (l..=self.order).step_by(2) {
                let norm = ((n as f64 + 1.0) / (2.0 * PI)).sqrt();
                out[[n, l]] = norm * radius.powi(l as i32) * now;
                let next = if k == 0.0 {
                    0.5 * ((b + 2.0) * x - b)
                } else {
                    let s = 2.0 * k + b;
                    let first = (s + 1.0) * (s * (s + 2.0) * x - b * b) * now;
                    let second = 2.0 * k * (k + b) * (s + 2.0) * before;
                    (first - second) / (2.0 * (k + 1.0) * (k + b + 1.0) * s)
                };
                (before, now) = (now, next);
                k += 1.0;
            }
        }
        out
    }
}

impl Fit for Koenderink {
    type Model = KoenderinkModel;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        check(pairs, values)?;
        let modes = Modes::new(self.order);
        let design = modes.design(pairs);
        let values = values.to_owned();
        let solution = self.solver.solve(&LeastSquares::new(&design, &values)?)?;
        Ok(KoenderinkModel {
            modes,
            coefficients: solution.beta,
        })
    }
}

impl KoenderinkModel {
    fn values_at(&self, pairs: &[DirectionPair]) -> Result<Array2<f64>> {
        check_directions(pairs)?;
        let values = self.modes.design(pairs).dot(&self.coefficients);
        Ok(values.mapv_into(|value| value.max(0.0)))
    }
}

impl Brdf for KoenderinkModel {
    fn channels(&self) -> usize {
        self.coefficients.ncols()
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        assign(self.values_at(pairs)?, values)
    }
}

impl Model for KoenderinkModel {
    fn floats_per_channel(&self) -> usize {
        self.coefficients.nrows()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use elm::solve::PseudoInverse;
    use elm_datasets::geometry::cartesian;

    #[test]
    fn orders_have_the_published_numbers_of_coefficients() {
        // Koenderink et al., section 3.3: 5 terms for order 2, 55 for order 8.
        for (order, count) in [(0, 1), (2, 5), (8, 55)] {
            assert_eq!(Modes::new(order).indices.len(), count);
        }
    }

    #[test]
    fn polynomials_are_zernikes() {
        // F. Zernike, 1934: R_0^0 = 1, R_2^0 = 2r^2 - 1, R_4^0 = 6r^4 - 6r^2 + 1, R_1^1 = r,
        // R_3^1 = 3r^3 - 2r, R_5^1 = 10r^5 - 12r^3 + 3r, R_4^2 = 4r^4 - 3r^2.
        let r: f64 = 0.6;
        let theta = Modes::new(5).polynomials(r * r);
        let expected = [
            ([0, 0], 1.0),
            ([2, 0], 2.0 * r.powi(2) - 1.0),
            ([4, 0], 6.0 * r.powi(4) - 6.0 * r.powi(2) + 1.0),
            ([1, 1], r),
            ([3, 1], 3.0 * r.powi(3) - 2.0 * r),
            ([5, 1], 10.0 * r.powi(5) - 12.0 * r.powi(3) + 3.0 * r),
            ([4, 2], 4.0 * r.powi(4) - 3.0 * r.powi(2)),
        ];
        for ([n, l], zernike) in expected {
            let norm = ((n as f64 + 1.0) / (2.0 * PI)).sqrt();
            assert_abs_diff_eq!(theta[[n, l]], norm * zernike, epsilon = 1e-14);
        }
    }

    #[test]
    fn round_polynomials_are_orthonormal_on_the_hemisphere() {
        // With u = rho^2 = 1 - cos(theta) a ring has the solid angle 2 pi du. The midpoint rule
        // errs by h^2 / 24 times the second derivative: for l = 0 the polynomials are Legendre's
        // P_k(2u - 1), k <= 4, with P_4' = 20 and P_4'' = 180 at most (by u), so that 9 P_4^2 has
        // one of 9 * 2 * (400 + 180) = 10440 at most: 2.8e-5 for 4000 points.
        let modes = Modes::new(8);
        let steps = 4000;
        let mut gram = Array2::<f64>::zeros((9, 9));
        for step in 0..steps {
            let theta = modes.polynomials((f64::from(step) + 0.5) / f64::from(steps));
            for n in (0..=8).step_by(2) {
                for m in (0..=8).step_by(2) {
                    gram[[n, m]] += theta[[n, 0]] * theta[[m, 0]] * 2.0 * PI / f64::from(steps);
                }
            }
        }
        for n in (0..=8).step_by(2) {
            for m in (0..=8).step_by(2) {
                let expected = f64::from(u8::from(n == m));
                assert_abs_diff_eq!(gram[[n, m]], expected, epsilon = 2.8e-5);
            }
        }
    }

    #[test]
    fn a_combination_of_modes_is_found_again_and_is_reciprocal() {
        let pairs: Vec<DirectionPair> = (0..60)
            .map(|i| {
                let i = f64::from(i);
                DirectionPair {
                    incident: cartesian((0.37 * i) % 1.5, 0.0),
                    outgoing: cartesian((0.73 * i) % 1.5, (1.13 * i) % 6.0),
                }
            })
            .collect();
        let truth = Array2::from_shape_vec((5, 1), vec![4.0, 0.3, -0.2, 0.1, 0.2]).unwrap();
        let values = Modes::new(2).design(&pairs).dot(&truth);
        assert!(values.iter().all(|&v| v > 0.0), "the bound at 0 is not met");
        let koenderink = Koenderink {
            order: 2,
            solver: PseudoInverse::default().into(),
        };
        let model = koenderink.fit(&pairs, values.view()).unwrap();
        assert_abs_diff_eq!(model.eval(&pairs).unwrap(), values, epsilon = 1e-12);
        let swapped: Vec<DirectionPair> = pairs.iter().map(|pair| pair.swapped()).collect();
        assert_abs_diff_eq!(model.eval(&swapped).unwrap(), values, epsilon = 1e-12);
    }
}
