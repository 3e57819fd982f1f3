//! The upper half of a square in files: its rows from the diagonal on, one after the other.

use ndarray::Array2;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::scalar::Scalar;

pub(super) fn serialize<A: Scalar, S: Serializer>(
    triangle: &Array2<A>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let rows = triangle.rows().into_iter().enumerate();
    let values = rows.flat_map(|(first, row)| row.into_iter().skip(first));
    values.copied().collect::<Vec<A>>().serialize(serializer)
}

pub(super) fn deserialize<'de, A: Scalar, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Array2<A>, D::Error> {
    let values = Vec::<A>::deserialize(deserializer)?;
    let columns = (((8 * values.len() + 1) as f64).sqrt() as usize - 1) / 2;
    if columns * (columns + 1) / 2 != values.len() {
        return Err(D::Error::custom(format!(
            "{} values are no triangle",
            values.len()
        )));
    }
    let mut triangle = Array2::zeros((columns, columns));
    let mut values = values.into_iter();
    for (first, mut row) in triangle.rows_mut().into_iter().enumerate() {
        for (to, value) in row.iter_mut().skip(first).zip(&mut values) {
            *to = value;
        }
    }
    Ok(triangle)
}
