//! How much a row pulls the fit to itself.

use ndarray::{Array1, ArrayView2};

use super::Accumulator;
use crate::dataset::TargetDim;
use crate::error::Result;
use crate::scalar::Scalar;

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// Number of inputs.
    pub(crate) fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of outputs.
    #[cfg(feature = "serde")]
    pub(crate) fn outputs(&self) -> usize {
        self.outputs
    }

    /// The leverage of rows for each unit of their weight, under ridge of this relative strength:
    /// $1 / W + \tilde h^T (\tilde H^T W \tilde H + \lambda s_1^2)^{-1} \tilde h$.
    pub(crate) fn unit_leverages(&self, x: ArrayView2<'_, A>, lambda: f64) -> Result<Array1<A>> {
        let mut all = self.clone();
        all.flush()?;
        let spectrum = all.spectrum()?;
        let frame = &spectrum.frame;
        let h = self.map.apply(x) / frame.hidden_scale;
        let centered = h - frame.hidden_mean.mapv(|m| m / frame.hidden_scale);
        let inside = A::product(centered.view(), spectrum.vt.t());
        let constant = if frame.intercept {
            frame.total_weight.recip()
        } else {
            A::zero()
        };
        let largest = spectrum.s.first().copied().unwrap_or(A::zero());
        let ridge = A::from_f64(lambda) * largest * largest;
        let leverage = |row: ndarray::ArrayView1<'_, A>| {
            let shares = row.iter().zip(&spectrum.s);
            let terms = shares.map(|(&p, &s)| p * p / (s * s + ridge));
            terms.sum::<A>() + constant
        };
        Ok(inside.rows().into_iter().map(leverage).collect())
    }
}
