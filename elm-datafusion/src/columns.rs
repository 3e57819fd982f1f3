//! From columns of a record batch to rows of numbers.

use datafusion::arrow::array::{Array, ArrayRef, AsArray};
use datafusion::arrow::datatypes::{DataType, Float64Type};
use datafusion::error::Result;
use datafusion::logical_expr::function::AccumulatorArgs;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::error::{failed, unplanned};

/// More arguments than this are refused: a row of them would not fit a layer of neurons either.
const MAX_ARGUMENTS: usize = 10_000;

/// What becomes of rows that have a NULL among the arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Nulls {
    /// They are left out, and counted.
    Skip,
    /// They are an error.
    Error,
}

/// Rows of some columns.
pub(crate) struct Rows {
    /// Shape (rows without NULL, columns).
    pub(crate) values: Array2<f64>,
    /// Rows that had a NULL.
    pub(crate) skipped: u64,
}

/// Whether all arguments are numbers, and what they are to be converted to.
pub(crate) fn numbers(function: &str, types: &[DataType], first: usize) -> Result<Vec<DataType>> {
    if types.len() > MAX_ARGUMENTS {
        let count = types.len();
        let reason = format!("{count} arguments; expected at most {MAX_ARGUMENTS}");
        return Err(unplanned(function, reason));
    }
    for (number, data_type) in types.iter().enumerate() {
        let number = number + first;
        if !(data_type.is_numeric() || matches!(data_type, DataType::Null | DataType::Boolean)) {
            let reason = format!("argument {number} is {data_type}; expected a number");
            return Err(unplanned(function, reason));
        }
    }
    Ok(vec![DataType::Float64; types.len()])
}

/// The rows of a batch without those that have a NULL.
pub(crate) fn rows(
    function: &str,
    names: &[String],
    columns: &[ArrayRef],
    nulls: Nulls,
) -> Result<Rows> {
    let count = columns.first().map_or(0, |column| column.len());
    let mut numeric = Vec::with_capacity(columns.len());
    for (number, column) in columns.iter().enumerate() {
        let reason = || {
            let argument = argument(number, names);
            format!("{argument} is {}; expected Float64", column.data_type())
        };
        let column = column.as_primitive_opt::<Float64Type>();
        numeric.push(column.ok_or_else(|| failed(function, reason()))?);
    }
    let mut kept: Vec<usize> = (0..count).collect();
    for (number, column) in numeric.iter().enumerate() {
        if column.null_count() > 0 {
            if nulls == Nulls::Error {
                let argument = argument(number, names);
                let reason = format!("{argument} is NULL in a row, and elm.nulls is 'error'");
                return Err(failed(function, reason));
            }
            kept.retain(|&row| column.is_valid(row));
        }
    }
    let mut values = Array2::zeros((kept.len(), columns.len()));
    for (column, mut target) in numeric.iter().zip(values.columns_mut()) {
        let column = column.values();
        for (&row, target) in kept.iter().zip(&mut target) {
            *target = column[row];
        }
    }
    let skipped = (count - kept.len()) as u64;
    Ok(Rows { values, skipped })
}

/// What the arguments are called in the query.
pub(crate) fn names(args: &AccumulatorArgs<'_>) -> Vec<String> {
    let names = args.expr_fields.iter().map(|field| field.name().clone());
    names.collect()
}

/// An argument as errors call it.
pub(crate) fn argument(number: usize, names: &[String]) -> String {
    match names.get(number) {
        Some(name) if !name.is_empty() => format!("argument {} ({name})", number + 1),
        _ => format!("argument {}", number + 1),
    }
}

/// An error of the library, with the argument's name where it gives a number of an input.
pub(crate) fn named(error: &elm::Error, names: &[String], leading: usize) -> String {
    let input = match error {
        elm::Error::ConstantInput { input, .. } | elm::Error::UnlikeRows { input, .. } => *input,
        elm::Error::NotFinite {
            what: "inputs",
            column,
            ..
        } => *column,
        _ => return error.to_string(),
    };
    format!(
        "{error}; input {input} is {}",
        argument(input + leading, names)
    )
}

/// The values of a column of states; NULL is none.
pub(crate) fn binaries<'a>(
    function: &str,
    states: &'a [ArrayRef],
) -> Result<impl Iterator<Item = &'a [u8]>> {
    let column = states
        .first()
        .and_then(|states| states.as_binary_view_opt());
    let column = column.ok_or_else(|| failed(function, "a state that is not binary"))?;
    Ok(column.iter().flatten())
}
