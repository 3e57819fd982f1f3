//! What a network is fitted to: inputs, targets, and what is known of the rows.

mod arrays;
mod folds;
mod rows;

use ndarray::{ArrayRef1, ArrayView, ArrayView1, ArrayView2, Ix2};

use crate::check::{check_finite, check_length, check_weights};
use crate::error::Result;
use crate::scalar::Scalar;
pub use arrays::{Inputs, TargetDim, Targets};
pub(crate) use arrays::{check_outputs, matrix, per_output};
pub use folds::{assign_blocks, assign_folds};
pub(crate) use rows::{RepeatedRows, Rows, counts};

/// Training data: inputs and targets, and where wanted a weight and a group for each row. Borrowed, and
/// checked once, however many fits are made of it.
///
/// Weights multiply the squared residuals, and count in all that is made of the rows: means and
/// deviations for the standardization, the rows that biases and centers are laid on (drawn in proportion
/// to their weights), the solve, and errors. A row of weight 0 is no row, at a given relative $\lambda$ of
/// ridge a row of weight 2 is two, and a factor of all weights says nothing. Rows of weight 0 must be
/// finite all the same.
///
/// Rows of one group are held out together: see [`folds`](Self::folds).
///
/// ```
/// use elm::{Dataset, ElmParams};
/// use ndarray::{Array1, Axis};
///
/// let x = Array1::linspace(-3.0, 3.0, 60).insert_axis(Axis(1));
/// let t = x.column(0).mapv(f64::sin);
/// let weights = t.mapv(|t| 1.0 + t * t);
/// // Ten samples, each measured six times.
/// let samples: Vec<usize> = (0..60).map(|row| row / 6).collect();
/// let data = Dataset::new(&x, &t)?.with_weights(&weights)?.with_groups(&samples)?;
///
/// let params = ElmParams::new(20);
/// let held_out = params.cross_val_predict(&data, &data.folds(5, 1)?)?;
/// let model = params.fit_dataset(&data)?;
/// println!("held-out RMSE {:.1e}", held_out.rmse());
/// # assert!(held_out.rmse() < 0.1 && model.score(&x, &t)? > 0.99);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Dataset<'a, A: Scalar, D: TargetDim = Ix2> {
    inputs: ArrayView2<'a, A>,
    targets: ArrayView<'a, A, D>,
    weights: Option<ArrayView1<'a, A>>,
    groups: Option<&'a [usize]>,
}

impl<'a, A: Scalar, D: TargetDim> Dataset<'a, A, D> {
    /// `x` has shape (rows, inputs); `t` has shape (rows, outputs), or one value per row. There may be no
    /// rows, as in a piece of data that an [accumulator](crate::Accumulator) takes in; fits need some.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) for targets of another number of rows,
    /// [`Error::NotFinite`](crate::Error::NotFinite) at the first NaN or infinity.
    pub fn new<X, T>(x: &'a X, t: &'a T) -> Result<Self>
    where
        X: Inputs<A> + ?Sized,
        T: Targets<A, Dim = D> + ?Sized,
    {
        let (inputs, targets) = (x.as_matrix(), t.as_array());
        check_finite("inputs", inputs)?;
        let matrix = D::matrix_view(targets.view());
        check_finite("targets", matrix.view())?;
        check_length("rows of targets", matrix.nrows(), inputs.nrows())?;
        Ok(Self {
            inputs,
            targets,
            weights: None,
            groups: None,
        })
    }

    /// Of arrays that have been checked.
    pub(crate) fn of_views(inputs: ArrayView2<'a, A>, targets: ArrayView<'a, A, D>) -> Self {
        Self {
            inputs,
            targets,
            weights: None,
            groups: None,
        }
    }

    /// A weight for the squared residual of each row.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) when there is not one per row,
    /// [`Error::Parameter`](crate::Error::Parameter) when one is negative or not finite. That all are 0 the
    /// fit refuses.
    #[doc(alias = "sample_weight")]
    pub fn with_weights(mut self, weights: &'a ArrayRef1<A>) -> Result<Self> {
        check_weights(weights.view(), self.rows())?;
        self.weights = Some(weights.view());
        Ok(self)
    }

    /// The group of each row, any numbers.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) when there is not one per row.
    pub fn with_groups(mut self, groups: &'a [usize]) -> Result<Self> {
        check_length("groups of rows", groups.len(), self.rows())?;
        self.groups = Some(groups);
        Ok(self)
    }

    /// The same rows with these groups, one for each.
    pub(crate) fn in_groups<'b>(&'b self, groups: &'b [usize]) -> Dataset<'b, A, D> {
        Dataset {
            inputs: self.inputs(),
            targets: self.targets(),
            weights: self.weights(),
            groups: Some(groups),
        }
    }

    /// Assigns each row to one of `folds` folds at random: sizes differ by at most 1 or, where rows have
    /// groups, numbers of groups do, and no group is in two folds. One seed gives one assignment on
    /// every platform.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) unless there are at least 2 folds, and at most as many
    /// as rows or groups.
    #[doc(alias = "GroupKFold")]
    pub fn folds(&self, folds: usize, seed: u64) -> Result<Vec<usize>> {
        match self.groups {
            Some(groups) => folds::assign_groups(groups, folds, seed),
            None => assign_folds(self.rows(), folds, seed),
        }
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.inputs.nrows()
    }

    /// The inputs, shape (rows, inputs).
    #[must_use]
    pub fn inputs(&self) -> ArrayView2<'_, A> {
        self.inputs.view()
    }

    /// The targets, shape (rows, outputs) or (rows).
    #[must_use]
    pub fn targets(&self) -> ArrayView<'_, A, D> {
        self.targets.view()
    }

    /// The weights, where there are any.
    #[must_use]
    pub fn weights(&self) -> Option<ArrayView1<'_, A>> {
        self.weights.as_ref().map(|weights| weights.view())
    }

    /// The group of each row, where there are groups.
    #[must_use]
    pub fn groups(&self) -> Option<&'a [usize]> {
        self.groups
    }

    /// The targets with shape (rows, outputs).
    pub(crate) fn target_matrix(&self) -> ArrayView2<'_, A> {
        D::matrix_view(self.targets.view())
    }
}
