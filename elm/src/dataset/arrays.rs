//! What inputs and targets are made of, and the dimension that predictions share with targets.

use std::convert::Infallible;

use ndarray::{
    Array, Array1, Array2, ArrayBase, ArrayRef, ArrayView, ArrayView2, ArrayViewMut, ArrayViewMut2,
    Axis, Data, Dimension, Ix1, Ix2, aview1,
};

use crate::error::{Error, Result};
use crate::scalar::Scalar;

/// Inputs: a matrix of shape (rows, inputs), owned or a view.
///
/// A vector is refused, as nothing says whether it is one row or one column:
///
/// ```compile_fail
/// use ndarray::array;
///
/// let (x, t) = (array![0.0, 1.0, 2.0], array![0.0, 1.0, 4.0]);
/// let model = elm::ElmParams::new(10).fit(&x, &t);
/// ```
///
/// ```
/// use ndarray::{Axis, array};
///
/// let (x, t) = (array![0.0, 1.0, 2.0], array![0.0, 1.0, 4.0]);
/// let model = elm::ElmParams::new(10).fit(&x.insert_axis(Axis(1)), &t)?;
/// # Ok::<(), elm::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no matrix of inputs",
    label = "expected an array of shape (rows, inputs) of `f32` or `f64`",
    note = "write `x.insert_axis(Axis(1))` (or `x.view().insert_axis(Axis(1))`) for a vector with one input per row",
    note = "write `x.insert_axis(Axis(0))` for a vector that is one row",
    note = "write `Array2::from_shape_vec((rows, inputs), values)?` for a `Vec` or a slice"
)]
pub trait Inputs<A: Scalar> {
    /// The inputs with shape (rows, inputs).
    fn as_matrix(&self) -> ArrayView2<'_, A>;
}

impl<A: Scalar> Inputs<A> for ArrayRef<A, Ix2> {
    fn as_matrix(&self) -> ArrayView2<'_, A> {
        self.view()
    }
}

impl<A: Scalar, S: Data<Elem = A>> Inputs<A> for ArrayBase<S, Ix2> {
    fn as_matrix(&self) -> ArrayView2<'_, A> {
        self.view()
    }
}

/// Training targets: a matrix of shape (rows, outputs); or one value per row, as a vector of ndarray, a
/// slice, an array or a `Vec`. Predictions have the same dimension.
///
/// ```
/// use elm::ElmParams;
/// use ndarray::array;
///
/// let x = array![[0.0], [0.5], [1.0], [1.5]];
/// let one = ElmParams::new(10).fit(&x, &vec![0.0, 0.25, 1.0, 2.25])?;
/// assert_eq!(one.predict(&x)?.shape(), [4]);
/// let two = ElmParams::new(10).fit(&x, &array![[0.0, 1.0], [0.2, 0.9], [1.0, 0.0], [2.2, -1.2]])?;
/// assert_eq!(two.predict(&x)?.shape(), [4, 2]);
/// # Ok::<(), elm::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be targets",
    label = "expected one value per row, or a matrix of shape (rows, outputs)",
    note = "targets are an ndarray of one or two dimensions, a slice or a `Vec`, of the scalar type of the inputs"
)]
pub trait Targets<A: Scalar> {
    /// [`Ix1`](type@Ix1) for one value per row, [`Ix2`](type@Ix2) for a matrix.
    type Dim: TargetDim;

    /// The targets as they are.
    fn as_array(&self) -> ArrayView<'_, A, Self::Dim>;
}

impl<A: Scalar, D: TargetDim> Targets<A> for ArrayRef<A, D> {
    type Dim = D;

    fn as_array(&self) -> ArrayView<'_, A, D> {
        self.view()
    }
}

impl<A: Scalar, D: TargetDim, S: Data<Elem = A>> Targets<A> for ArrayBase<S, D> {
    type Dim = D;

    fn as_array(&self) -> ArrayView<'_, A, D> {
        self.view()
    }
}

impl<A: Scalar> Targets<A> for [A] {
    type Dim = Ix1;

    fn as_array(&self) -> ArrayView<'_, A, Ix1> {
        aview1(self)
    }
}

impl<A: Scalar, const N: usize> Targets<A> for [A; N] {
    type Dim = Ix1;

    fn as_array(&self) -> ArrayView<'_, A, Ix1> {
        aview1(self)
    }
}

impl<A: Scalar> Targets<A> for Vec<A> {
    type Dim = Ix1;

    fn as_array(&self) -> ArrayView<'_, A, Ix1> {
        aview1(self)
    }
}

/// The dimension of targets and of predictions: [`Ix1`](type@Ix1), one value per row, or [`Ix2`](type@Ix2),
/// shape (rows, outputs). Sealed.
pub trait TargetDim: Dimension + sealed::Matrix {
    /// One value for each output: the value itself, or a vector of them.
    type PerOutput<T>;

    /// Makes it of the value of each output, by its number.
    ///
    /// # Errors
    /// The first that `of` returns.
    fn per_output<T, E>(
        outputs: usize,
        of: impl FnMut(usize) -> Result<T, E>,
    ) -> Result<Self::PerOutput<T>, E>;
}

impl TargetDim for Ix1 {
    type PerOutput<T> = T;

    fn per_output<T, E>(_: usize, mut of: impl FnMut(usize) -> Result<T, E>) -> Result<T, E> {
        of(0)
    }
}

impl TargetDim for Ix2 {
    type PerOutput<T> = Array1<T>;

    fn per_output<T, E>(
        outputs: usize,
        of: impl FnMut(usize) -> Result<T, E>,
    ) -> Result<Array1<T>, E> {
        (0..outputs)
            .map(of)
            .collect::<Result<Vec<T>, E>>()
            .map(Array1::from)
    }
}

/// Targets as they are, with shape (rows, outputs).
pub(crate) fn matrix<A: Scalar, D: TargetDim>(array: ArrayView<'_, A, D>) -> ArrayView2<'_, A> {
    D::matrix_view(array)
}

/// The value of each output, by its number.
pub(crate) fn per_output<D: TargetDim, T>(
    outputs: usize,
    mut of: impl FnMut(usize) -> T,
) -> D::PerOutput<T> {
    let Ok(all) = D::per_output(outputs, |output| Ok::<T, Infallible>(of(output)));
    all
}

mod sealed {
    use super::{Array, Array2, ArrayView, ArrayView2, ArrayViewMut, ArrayViewMut2, Dimension};

    /// From and to matrices. A matrix that becomes a vector has one column.
    pub trait Matrix: Dimension {
        /// Whether there is one output and no more.
        const SINGLE: bool;

        fn of_matrix<A>(matrix: Array2<A>) -> Array<A, Self>;
        fn of_matrix_view<A>(matrix: ArrayView2<'_, A>) -> ArrayView<'_, A, Self>;
        fn matrix_view<A>(array: ArrayView<'_, A, Self>) -> ArrayView2<'_, A>;
        fn matrix_view_mut<A>(array: ArrayViewMut<'_, A, Self>) -> ArrayViewMut2<'_, A>;
    }
}

impl sealed::Matrix for Ix1 {
    const SINGLE: bool = true;

    fn of_matrix<A>(matrix: Array2<A>) -> Array1<A> {
        matrix.index_axis_move(Axis(1), 0)
    }

    fn of_matrix_view<A>(matrix: ArrayView2<'_, A>) -> ArrayView<'_, A, Ix1> {
        matrix.index_axis_move(Axis(1), 0)
    }

    fn matrix_view<A>(array: ArrayView<'_, A, Ix1>) -> ArrayView2<'_, A> {
        array.insert_axis(Axis(1))
    }

    fn matrix_view_mut<A>(array: ArrayViewMut<'_, A, Ix1>) -> ArrayViewMut2<'_, A> {
        array.insert_axis(Axis(1))
    }
}

impl sealed::Matrix for Ix2 {
    const SINGLE: bool = false;

    fn of_matrix<A>(matrix: Array2<A>) -> Array2<A> {
        matrix
    }

    fn of_matrix_view<A>(matrix: ArrayView2<'_, A>) -> ArrayView2<'_, A> {
        matrix
    }

    fn matrix_view<A>(array: ArrayView2<'_, A>) -> ArrayView2<'_, A> {
        array
    }

    fn matrix_view_mut<A>(array: ArrayViewMut2<'_, A>) -> ArrayViewMut2<'_, A> {
        array
    }
}

/// Whether a network of `outputs` outputs can predict arrays of this dimension.
pub(crate) fn check_outputs<D: TargetDim>(outputs: usize) -> Result<()> {
    if D::SINGLE && outputs != 1 {
        return Err(Error::Shape {
            what: "outputs of a network that predicts one value per row (Ix1)",
            expected: 1,
            found: outputs,
        });
    }
    Ok(())
}
