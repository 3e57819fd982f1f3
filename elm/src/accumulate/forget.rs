//! Exponential forgetting, for what drifts.

use super::Accumulator;
use crate::dataset::TargetDim;
use crate::error::{Error, Result};
use crate::scalar::Scalar;

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// Lets all rows so far count less: their weights are multiplied by `factor`, from 0 (all are forgotten)
    /// to 1 (none is). Called before every push, rows that came `k` pushes ago weigh `factor` to the power of
    /// `k`, so that the fit follows what drifts. Costs a pass over what is kept.
    ///
    /// The number of rows that generalized cross-validation divides by shrinks alike, to about
    /// `rows / (1 - factor)` for pushes of `rows` rows. [`rows`](Self::rows), the random layer, the scaler
    /// and the bounds of predictions remain those of all rows.
    ///
    /// There is no window that takes old rows off again: what is subtracted leaves its
    /// rounding errors behind, which grow with the condition squared (Golub and Van Loan, Matrix
    /// Computations, 2013, section 6.5).
    ///
    /// ```
    /// use elm::{Accumulator, ElmParams, Scaler, solve::Ridge};
    /// use ndarray::{Array2, array};
    ///
    /// let x = Array2::from_shape_fn((50, 1), |(i, _)| i as f64 / 25.0 - 1.0);
    /// let scaler = Scaler::measured(&x)?;
    /// let params = ElmParams::new(10).with_solver(Ridge::relative(1e-6));
    /// let mut recent = Accumulator::<f64>::with_scaler(&params, scaler, 1)?;
    /// for day in 0..20 {
    ///     recent.forget(0.5)?;
    ///     // A slope that grows day by day.
    ///     recent.push(&x, &(&x * day as f64))?;
    /// }
    /// let slope = recent.fit()?.predict(&array![[0.5]])?[[0, 0]] / 0.5;
    /// // The weighted mean of 19, 18, 17 and so on, each of half the weight of the one before.
    /// assert!((slope - 18.0).abs() < 0.1);
    /// # Ok::<(), elm::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Parameter`] unless `factor` lies between 0 and 1; nothing is forgotten then.
    pub fn forget(&mut self, factor: f64) -> Result<()> {
        if !(0.0..=1.0).contains(&factor) {
            return Err(Error::Parameter {
                name: "factor",
                value: factor,
                expected: "from 0 to 1",
            });
        }
        let root = A::from_f64(factor.sqrt());
        self.kept *= match self.keeps_products() {
            true => root * root,
            false => root,
        };
        self.pending.iter_mut().for_each(|value| *value *= root);
        self.drop_weightless_rows();
        let shrunk = |rows: u64| rows as f64 * factor;
        self.weighted_rows = shrunk(self.weighted_rows).ceil() as u64;
        for far in &mut self.far {
            *far = shrunk(*far) as u64;
        }
        Ok(())
    }

    /// Drops pending rows whose weight has vanished, of which no means could be taken.
    fn drop_weightless_rows(&mut self) {
        let columns = self.columns();
        // With an intercept the first column is the root of the weight.
        let weighty = |row: &&[A]| match self.intercept {
            true => row[0] > A::zero(),
            false => row.iter().any(|value| *value != A::zero()),
        };
        if !self.pending.chunks_exact(columns).all(|row| weighty(&row)) {
            let rows = self.pending.chunks_exact(columns).filter(weighty);
            self.pending = rows.flatten().copied().collect();
        }
    }
}
