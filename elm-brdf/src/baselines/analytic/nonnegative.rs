//! Least squares of up to three weights that are not negative, from the normal equations.

use super::family::MAX_TERMS;

/// The normal equations of $\min \lVert \Phi w - y \rVert^2$.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal {
    /// $\Phi^T \Phi$.
    pub(super) gram: [[f64; MAX_TERMS]; MAX_TERMS],
    /// $\Phi^T y$.
    pub(super) moments: [f64; MAX_TERMS],
}

impl Normal {
    /// The weights $w \ge 0$ of the smallest error, and by how much the squared error lies below
    /// that of $w = 0$.
    ///
    /// The best weights are the unconstrained ones of those terms that are not 0 in them, so the
    /// best of all subsets whose unconstrained weights are positive is the answer; there are at
    /// most seven.
    pub(super) fn solve(&self, terms: usize) -> ([f64; MAX_TERMS], f64) {
        let mut best = ([0.0; MAX_TERMS], 0.0);
        for subset in 1..1_usize << terms {
            let Some(weights) = self.subset(subset) else {
                continue;
            };
            // At the minimum w . Phi^T y = w . G w.
            let gain: f64 = weights.iter().zip(&self.moments).map(|(w, m)| w * m).sum();
            if gain > best.1 && weights.iter().all(|&w| w >= 0.0) {
                best = (weights, gain);
            }
        }
        best
    }

    /// The unconstrained weights of the terms in `subset`, a bit per term; `None` where these
    /// terms depend on each other.
    fn subset(&self, subset: usize) -> Option<[f64; MAX_TERMS]> {
        let inside = |term: usize| subset >> term & 1 == 1;
        // Rows and columns of the other terms become those of the unit matrix.
        let mut a = [[0.0; MAX_TERMS]; MAX_TERMS];
        let mut b = [0.0; MAX_TERMS];
        for i in 0..MAX_TERMS {
            if !inside(i) {
                a[i][i] = 1.0;
                continue;
            }
            b[i] = self.moments[i];
            for j in (0..MAX_TERMS).filter(|&j| inside(j)) {
                a[i][j] = self.gram[i][j];
            }
        }
        // Terms of very different size are no reason to call them dependent.
        let scale = [0, 1, 2].map(|term| a[term][term].sqrt());
        if scale.iter().any(|&s| !(s > 0.0 && s.is_finite())) {
            return None;
        }
        for i in 0..MAX_TERMS {
            for j in 0..MAX_TERMS {
                a[i][j] /= scale[i] * scale[j];
            }
            b[i] /= scale[i];
        }
        let mut x = solve(a, b)?;
        for (x, scale) in x.iter_mut().zip(scale) {
            *x /= scale;
        }
        Some(x)
    }
}

/// Solves a symmetric positive definite system by Cholesky's method; `None` where a pivot is
/// rounding of the diagonal, which must be of order 1.
pub(super) fn solve<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> Option<[f64; N]> {
    for j in 0..N {
        for k in 0..j {
            a[j][j] -= a[j][k] * a[j][k];
        }
        if a[j][j] <= 1e-13 || a[j][j].is_nan() {
            return None;
        }
        a[j][j] = a[j][j].sqrt();
        for i in j + 1..N {
            for k in 0..j {
                a[i][j] -= a[i][k] * a[j][k];
            }
            a[i][j] /= a[j][j];
        }
    }
    for i in 0..N {
        for k in 0..i {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    for i in (0..N).rev() {
        for k in i + 1..N {
            b[i] -= a[k][i] * b[k];
        }
        b[i] /= a[i][i];
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn an_unconstrained_minimum_that_is_positive_is_the_answer() {
        // Orthogonal terms of squared length 1, 4, 9: w = moments / squared length.
        let normal = Normal {
            gram: [[1.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 9.0]],
            moments: [3.0, 2.0, 9.0],
        };
        let (weights, gain) = normal.solve(3);
        assert_abs_diff_eq!(&weights[..], &[3.0, 0.5, 1.0][..], epsilon = 1e-14);
        // Sum of w * moment.
        assert_abs_diff_eq!(gain, 9.0 + 1.0 + 9.0, epsilon = 1e-13);
    }

    #[test]
    fn a_negative_weight_is_not_clipped_but_its_term_left_out() {
        // Phi = [[1, 1], [0, 1]], y = (2, -1): unconstrained (3, -1). With w_2 = 0 the best w_1
        // is 2; with w_1 = 0 the best w_2 is 1/2, which is worse.
        let normal = Normal {
            gram: [[1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0; 3]],
            moments: [2.0, 1.0, 0.0],
        };
        let (weights, gain) = normal.solve(2);
        assert_abs_diff_eq!(&weights[..], &[2.0, 0.0, 0.0][..], epsilon = 1e-14);
        assert_abs_diff_eq!(gain, 4.0, epsilon = 1e-14);
    }

    #[test]
    fn equal_terms_and_empty_terms_are_no_trouble() {
        let normal = Normal {
            gram: [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0; 3]],
            moments: [1.0, 1.0, 0.0],
        };
        let (weights, gain) = normal.solve(3);
        assert_abs_diff_eq!(weights.iter().sum::<f64>(), 1.0, epsilon = 1e-14);
        assert_abs_diff_eq!(gain, 1.0, epsilon = 1e-14);
    }
}
