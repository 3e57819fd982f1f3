//! How far a prediction for a new row moves when training rows are left out.

use ndarray::{Array1, Array2, ArrayRef2, ArrayView1, Zip};

use super::{CrossValidator, posterior};
use crate::scalar::Scalar;
use crate::solve::design_svd::DesignSvd;

/// What leaving out the rows of each label adds to a prediction of one output: a linear function of the new
/// row's hidden values.
#[derive(Debug, Clone)]
pub(crate) struct Shifts<A: Scalar> {
    /// What hidden values are divided by.
    scale: A,
    /// What is then taken off each column.
    mean: Array1<A>,
    /// Shape (labels, columns).
    slopes: Array2<A>,
    /// One for each label.
    constants: Array1<A>,
}

impl<A: Scalar> Shifts<A> {
    /// What is added to the prediction for each new hidden row where the rows of its label are left out.
    pub(crate) fn of_rows(&self, hidden: &ArrayRef2<A>, labels: &[usize]) -> Array1<A> {
        let shift = |(row, &label): (ArrayView1<'_, A>, &usize)| {
            let values = row.iter().zip(&self.mean).zip(self.slopes.row(label));
            // Scaled before centering, as the difference of two huge values may overflow.
            let along: A = values
                .map(|((&h, &mean), &slope)| (h / self.scale - mean) * slope)
                .sum();
            along + self.constants[label]
        };
        hidden.rows().into_iter().zip(labels).map(shift).collect()
    }
}

impl<A: Scalar> CrossValidator<A> {
    /// $1/n + \tilde h^T (\tilde H^T \tilde H + \lambda)^{-1} \tilde h_i$ for one new hidden row and every
    /// training row $i$, times its weight: leaving out row $i$ lowers the prediction by its leave-one-out
    /// residual times this; leaving out several, by the sum of their held-out residuals times these.
    pub(crate) fn influence(&self, hidden: &ArrayRef2<A>, lambda: f64) -> Array1<A> {
        let DesignSvd { frame, vt, .. } = &self.rows.spectrum;
        let mean = frame.hidden_mean.mapv(|m| m / frame.hidden_scale);
        let (inside, _) = posterior::coordinates(hidden, frame.hidden_scale, &mean, vt);
        let gain = self.rows.spectrum.ridge_gain(&[A::from_f64(lambda)]);
        let along = &inside.row(0) * &gain.column(0);
        let share = self.constant_share();
        let roots = &self.rows.spectrum.frame.root_weights;
        Zip::from(&self.rows.u.dot(&along))
            .and(roots)
            .map_collect(|&along, &root| root * (along + root * share))
    }

    /// What leaving out the rows of each label adds to predictions of an output with these held-out
    /// residuals: less the sum of its rows' residuals times their [influence](Self::influence). Labels are
    /// counted from 0.
    pub(crate) fn shifts(
        &self,
        residuals: ArrayView1<'_, A>,
        labels: &[usize],
        lambda: f64,
    ) -> Shifts<A> {
        let DesignSvd { frame, vt, .. } = &self.rows.spectrum;
        let count = labels.iter().max().map_or(0, |last| last + 1);
        let share = self.constant_share();
        let mut coordinates = Array2::zeros((count, vt.nrows()));
        let mut constants = Array1::zeros(count);
        let rows = self.rows.u.rows().into_iter().zip(&frame.root_weights);
        for (((u, &root), &residual), &label) in rows.zip(residuals).zip(labels) {
            coordinates.row_mut(label).scaled_add(-root * residual, &u);
            constants[label] -= root * root * residual * share;
        }
        coordinates *= &self
            .rows
            .spectrum
            .ridge_gain(&[A::from_f64(lambda)])
            .column(0);
        Shifts {
            scale: frame.hidden_scale,
            mean: frame.hidden_mean.mapv(|m| m / frame.hidden_scale),
            slopes: A::product(coordinates.view(), vt.view()),
            constants,
        }
    }
}
