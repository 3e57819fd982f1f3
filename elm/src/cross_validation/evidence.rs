//! The evidence (marginal likelihood) of a hidden layer, from the factorization of the fit.

use std::f64::consts::TAU;

use ndarray::Zip;

use super::CrossValidator;
use crate::error::{Error, Result};
use crate::scalar::Scalar;
use crate::solve::design_svd::DesignSvdWithRows;

impl<A: Scalar> CrossValidator<A> {
    /// The logarithm of each output's evidence, also called marginal likelihood: the density of its
    /// targets where output weights are normal with a variance of $\sigma^2 / \lambda$ (what ridge
    /// takes them to be), with the $\sigma$ that makes it largest, an intercept integrated out:
    /// $$-\frac12 \left[ m \ln \frac{2 \pi q}{m} + m + \sum_j \ln \frac{s_j^2 + \lambda}{\lambda} -
    /// \sum_i \ln w_i \right], \qquad q = \sum_j \frac{\lambda c_j^2}{s_j^2 + \lambda} + \sum_i r_i^2,$$
    /// with $m$ rows that count, one fewer with an intercept, and weights relative to the largest. It
    /// weighs fit against complexity, and may be compared between hidden layers of any size for the
    /// same rows and weights: with few rows it chooses among layers more surely than held-out errors,
    /// which a few rows decide.
    ///
    /// D. MacKay, *Bayesian Interpolation*, Neural Computation 4(3), 1992; the restricted likelihood:
    /// H. Patterson, R. Thompson, Biometrika 58(3), 1971.
    ///
    /// Infinite where a fit without error is certain (constant targets).
    ///
    /// # Errors
    /// [`Error::Shape`] when `lambda` has neither one entry nor one per output, [`Error::Parameter`]
    /// when one is not positive and finite, [`Error::Undetermined`] when no row is left to judge.
    pub fn log_evidence(&self, lambda: &[f64]) -> Result<Vec<f64>> {
        let DesignSvdWithRows {
            spectrum, residual, ..
        } = &self.rows;
        let frame = &spectrum.frame;
        let (mut present, mut log_weights) = (0_usize, 0.0);
        for root in frame.root_weights.iter().filter(|r| **r > A::zero()) {
            present += 1;
            log_weights += root.as_f64().ln();
        }
        let rows = present.saturating_sub(usize::from(frame.intercept)) as f64;
        if rows == 0.0 {
            return Err(Error::Undetermined { fold: 0 });
        }
        let mut evidence = vec![0.0; self.outputs()];
        for (strength, outputs) in self.by_strength(lambda)? {
            if strength <= A::zero() {
                return Err(Error::Parameter {
                    name: "lambda",
                    value: strength.as_f64(),
                    expected: "finite and positive",
                });
            }
            let complements = spectrum.filter_complements(strength).mapv(Scalar::as_f64);
            let complexity: f64 = complements.iter().map(|f| -f.ln()).sum();
            for output in outputs {
                let (beyond, along) = (residual.column(output), spectrum.c.column(output));
                let squares = beyond.iter().map(|r| r.as_f64().powi(2)).sum::<f64>()
                    + Zip::from(along)
                        .and(&complements)
                        .fold(0.0, |sum, c, f| sum + c.as_f64().powi(2) * f);
                let scale = frame.target_scale[output].as_f64();
                let spread = (TAU * squares / rows).ln() + 2.0 * scale.ln();
                evidence[output] = log_weights - 0.5 * (rows * (spread + 1.0) + complexity);
            }
        }
        Ok(evidence)
    }
}
