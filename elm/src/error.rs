//! What can go wrong, as one enum. Variants carry numbers and names; the text is made on display.

use thiserror::Error;

/// Result of everything in this crate that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a fit, a prediction or a file was refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting lies outside its range.
    #[error("{name} is {value}, but must be {expected}")]
    Parameter {
        /// The setting, as its setter is called.
        name: &'static str,
        /// What it was set to.
        value: f64,
        /// The range it must lie in.
        expected: &'static str,
    },
    /// An array has no rows or no columns.
    #[error("{what} is empty ({rows} x {columns})")]
    Empty {
        /// Which array.
        what: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
    },
    /// Two sizes that must agree do not.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// Which size.
        what: &'static str,
        /// The size it must have.
        expected: usize,
        /// The size it has.
        found: usize,
    },
    /// A value is NaN or infinite.
    #[error("{what}: the value at row {row}, column {column} (counted from 0) is not finite")]
    NotFinite {
        /// Which array.
        what: &'static str,
        /// Row of the first such value.
        row: usize,
        /// Column of the first such value.
        column: usize,
    },
    /// Equation 10 inverts the hidden-layer matrix, which must be square for that.
    #[error(
        "the solver 'inverse' (eq. 10) needs as many neurons as training rows, \
         found {neurons} neurons and {rows} rows"
    )]
    NotSquare {
        /// Rows of the hidden-layer matrix.
        rows: usize,
        /// Columns of the hidden-layer matrix.
        neurons: usize,
    },
    /// Equation 10 inverts the hidden-layer matrix, which must not be singular.
    #[error(
        "the hidden-layer matrix is singular to working precision \
         (reciprocal condition {reciprocal_condition:e}): eq. 10 has no answer"
    )]
    Singular {
        /// Smallest over largest singular value.
        reciprocal_condition: f64,
    },
    /// A matrix that is to be positive definite is not, to rounding, or holds a NaN.
    #[error("the matrix is not positive definite to rounding")]
    NotPositiveDefinite,
    /// Two settings exclude each other.
    #[error("{first} and {second} exclude each other")]
    Conflict {
        /// One setting.
        first: &'static str,
        /// The other setting.
        second: &'static str,
    },
    /// The rows outside a fold do not have a unique answer to the rows in it.
    #[error("the rows outside fold {fold} do not determine a prediction for those in it")]
    Undetermined {
        /// The fold's label; for leave-one-out the row, counted from 0.
        fold: usize,
    },
    /// All rows of positive weight are of one class.
    #[error("all rows are of one class: a classifier needs rows of at least two classes")]
    OneClass,
    /// A label that is none of the classes.
    #[error("the label of row {row} (counted from 0) is none of the classes")]
    UnknownClass {
        /// The first such row.
        row: usize,
    },
    /// Two accumulators that are to be merged are not of one kind.
    #[error("the accumulators have different {what}")]
    Mismatch {
        /// What differs.
        what: &'static str,
    },
    /// An input that was constant in the rows that its standardization was measured on is not in
    /// others: it would be lost.
    #[error(
        "input {input} (counted from 0) was {constant} in all rows that the scaler was measured on \
         and is {value} in row {row}: it would be ignored; measure the scaler on rows like these \
         (ScalerBuilder)"
    )]
    ConstantInput {
        /// Which input.
        input: usize,
        /// The first row where it is not what it was.
        row: usize,
        /// What it was.
        constant: f64,
        /// What it is.
        value: f64,
    },
    /// Rows are not like those that the standardization of inputs was measured on: too many of them
    /// lie where neurons are saturated.
    #[error(
        "input {input} (counted from 0) is more than 10 deviations from the scaler's mean in {far} \
         of {rows} rows: the scaler was measured on rows unlike these; measure it on rows like them \
         (ScalerBuilder)"
    )]
    UnlikeRows {
        /// Which input.
        input: usize,
        /// Rows where it is so far off.
        far: u64,
        /// Rows so far.
        rows: u64,
    },
    /// A factorization did not converge.
    #[error("{what} did not converge")]
    NoConvergence {
        /// Which factorization.
        what: &'static str,
    },
    /// A result lies outside the range of the floating-point type.
    #[error("{what} overflows the floating-point range")]
    Overflow {
        /// Which result.
        what: &'static str,
    },
    /// An array would be larger than memory. That is known before it is made: from the allocator and,
    /// on Linux, from what the system says is left, to this program's control group, too. What other
    /// programs take afterwards is not known: it can still end this one.
    #[error("{what} would be {rows} x {columns}, more than memory holds")]
    TooLarge {
        /// Which array.
        what: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
    },
    /// A name that is not one of those known.
    #[error("unknown {what} '{name}' (expected one of: {expected})")]
    UnknownName {
        /// What was being named.
        what: &'static str,
        /// The name that was given.
        name: String,
        /// The names there are.
        expected: &'static str,
    },
}
