//! Many materials measured at the same pairs of directions.

use std::fmt;
use std::str::FromStr;

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::geometry::DirectionPair;
use crate::material_id::MaterialId;
use crate::text::shorten;
use crate::{Error, Samples};

/// What to do with negative reflectance, which noise gives and physics does not.
///
/// A file of one material may also have values that are missing: cells without a number, and
/// [fill values](fill_values). Their rows are left out, except that [`Keep`](Self::Keep) takes
/// fill values as measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Invalid {
    /// Put zero in its place.
    #[default]
    Clamp,
    /// Leave it as measured.
    Keep,
    /// Leave the measurement out of that material, in all channels.
    Drop,
}

impl Invalid {
    /// Every way there is, the default first.
    pub const ALL: [Self; 3] = [Self::Clamp, Self::Keep, Self::Drop];

    /// The name that [`FromStr`] reads.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Clamp => "clamp",
            Self::Keep => "keep",
            Self::Drop => "drop",
        }
    }

    /// Treats the negative values among `values`, shape (rows, channels): the rows that are left,
    /// their values, and how many were negative. Rows with a value that is missing (NaN) are left
    /// out whatever is done with negative ones: there is nothing to put in its place.
    pub(crate) fn treat(self, mut values: Array2<f64>) -> (Vec<usize>, Array2<f64>, usize) {
        let invalid = values.iter().filter(|&&value| value < 0.0).count();
        let mut rows: Vec<usize> = (0..values.nrows()).collect();
        if values.iter().any(|value| value.is_nan()) {
            rows.retain(|&row| !values.row(row).iter().any(|value| value.is_nan()));
            values = values.select(ndarray::Axis(0), &rows);
        }
        match self {
            Self::Keep => {}
            // `<=`, so that a printed -0.000 loses its sign too.
            Self::Clamp => {
                values.mapv_inplace(|value| if value <= 0.0 { 0.0 } else { value });
            }
            Self::Drop => {
                let kept: Vec<usize> = (0..rows.len())
                    .filter(|&row| values.row(row).iter().all(|&value| value >= 0.0))
                    .collect();
                values = values.select(ndarray::Axis(0), &kept);
                rows = kept.iter().map(|&row| rows[row]).collect();
            }
        }
        (rows, values, invalid)
    }
}

/// The negative numbers that stand for missing values among `values`, such as -999, the most
/// negative first.
///
/// Noise is about as often above the truth as below it, so that no negative value of it is larger
/// in size than what else is measured. A value is a fill value if it recurs, is larger in size than
/// the median of the positive values, and at least twice as large as the next negative value that
/// is none; or, where it occurs once, if it is larger than ten times the largest of all.
///
/// ```
/// use elm_datasets::fill_values;
/// use ndarray::array;
///
/// assert_eq!(fill_values(&array![[0.1], [-999.0], [0.3], [-0.002], [-999.0]]), [-999.0]);
/// // Noise that was rounded recurs too.
/// assert!(fill_values(&array![[0.1], [-0.01], [0.3], [-0.01]]).is_empty());
/// ```
#[must_use]
pub fn fill_values(values: &Array2<f64>) -> Vec<f64> {
    let mut positive: Vec<f64> = values.iter().copied().filter(|&v| v > 0.0).collect();
    positive.sort_unstable_by(f64::total_cmp);
    let median = positive.get(positive.len() / 2).copied().unwrap_or(0.0);
    let largest = positive.last().copied().unwrap_or(0.0);
    let mut negative: Vec<f64> = values.iter().copied().filter(|&v| v < 0.0).collect();
    negative.sort_unstable_by(f64::total_cmp);
    let mut fills = Vec::new();
    let mut rest = negative.as_slice();
    while let Some(&value) = rest.first() {
        let count = rest.iter().take_while(|&&other| other == value).count();
        let next = rest.get(count).copied().unwrap_or(0.0);
        let size = -value;
        let recurs = count > 1 && size > median && size >= -2.0 * next;
        let alone = size > 10.0 * largest && size >= -2.0 * next;
        // Without anything positive there is no telling.
        if largest <= 0.0 || !(recurs || alone) {
            break;
        }
        fills.push(value);
        rest = &rest[count..];
    }
    fills
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Invalid {
    type Err = Error;

    /// # Errors
    /// [`Error::UnknownInvalid`] for anything but the three names, in either case.
    fn from_str(text: &str) -> Result<Self, Error> {
        Self::ALL
            .into_iter()
            .find(|way| way.name().eq_ignore_ascii_case(text.trim()))
            .ok_or_else(|| Error::UnknownInvalid {
                text: shorten(text),
            })
    }
}

/// Where measurements come from, so that a report can say so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Origin {
    /// Files in CUReT's layout.
    Curet,
    /// The [synthetic data](crate::synthetic), from formulas.
    Synthetic {
        /// Seed of the noise.
        seed: u64,
    },
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Curet => f.write_str("CUReT"),
            Self::Synthetic { seed } => write!(f, "synthetic, seed {seed}"),
        }
    }
}

/// Reflectance of several materials, all measured at the same pairs of directions.
///
/// ```
/// use elm_datasets::{Invalid, synthetic};
///
/// let set = synthetic::measurements(1, &[synthetic::find("matte 01")?], Invalid::Clamp);
/// assert_eq!(set.directions.len(), 205);
/// let samples = set.samples(0).ok_or("no such material")?;
/// assert_eq!(samples.values.dim(), (205, set.channels.len()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Measurements {
    /// Where the numbers come from.
    pub origin: Origin,
    /// The pairs of directions in the order of the measurements, 205 of them.
    pub directions: Vec<DirectionPair>,
    /// Name of each column of a material's values.
    pub channels: Vec<String>,
    /// The materials, in the order asked for.
    pub materials: Vec<Material>,
    /// Negative values met in these materials, before they were treated.
    pub invalid: usize,
}

/// Reflectance of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Its number.
    pub id: MaterialId,
    /// Its name.
    pub name: String,
    /// Index into [`Measurements::directions`] of each row of values, ascending: all of them,
    /// unless [`Invalid::Drop`] left some out.
    pub rows: Vec<usize>,
    /// BRDF in 1/sr without the cosine, shape (`rows.len()`, channels).
    pub values: Array2<f64>,
    /// Negative values met, before they were treated.
    pub invalid: usize,
}

impl Material {
    /// Treats the negative values among `values`, shape (directions, channels).
    pub(crate) fn new(id: MaterialId, name: &str, values: Array2<f64>, way: Invalid) -> Self {
        let (rows, values, invalid) = way.treat(values);
        Self {
            id,
            name: name.to_owned(),
            rows,
            values,
            invalid,
        }
    }
}

impl Measurements {
    pub(crate) fn new(
        origin: Origin,
        directions: Vec<DirectionPair>,
        channels: &[&str],
        materials: Vec<Material>,
    ) -> Self {
        Self {
            origin,
            directions,
            channels: channels.iter().map(|&name| name.to_owned()).collect(),
            invalid: materials.iter().map(|material| material.invalid).sum(),
            materials,
        }
    }

    /// The `index`-th material with its own directions; `None` if there are fewer materials, or
    /// if one of its rows is not among the directions.
    #[must_use]
    pub fn samples(&self, index: usize) -> Option<Samples> {
        let material = self.materials.get(index)?;
        Some(Samples {
            directions: material
                .rows
                .iter()
                .map(|&row| self.directions.get(row).copied())
                .collect::<Option<_>>()?,
            values: material.values.clone(),
            channels: self.channels.clone(),
        })
    }

    /// The material with this number, if it is among these.
    #[must_use]
    pub fn material(&self, id: MaterialId) -> Option<&Material> {
        self.materials.iter().find(|material| material.id == id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    fn treated(way: Invalid) -> Material {
        let values = array![[0.1, 0.2], [-0.001, 0.3], [0.4, -0.0], [-0.2, -0.3]];
        Material::new(MaterialId::new(1).unwrap(), "x", values, way)
    }

    #[test]
    fn negative_values_are_counted_whatever_becomes_of_them() {
        for way in Invalid::ALL {
            assert_eq!(treated(way).invalid, 3, "{way}");
        }
    }

    #[test]
    fn clamping_leaves_no_negative_value_and_no_negative_zero() {
        let material = treated(Invalid::Clamp);
        assert_eq!(material.rows, [0, 1, 2, 3]);
        assert!(material.values.iter().all(|value| value.is_sign_positive()));
    }

    #[test]
    fn dropping_leaves_out_the_row_in_all_channels_and_keeps_zeros() {
        let material = treated(Invalid::Drop);
        assert_eq!(material.rows, [0, 2]);
        assert_eq!(material.values, array![[0.1, 0.2], [0.4, 0.0]]);
    }

    #[test]
    fn ways_are_read_by_the_names_they_print() {
        for way in Invalid::ALL {
            assert_eq!(
                way.to_string().to_uppercase().parse::<Invalid>().unwrap(),
                way
            );
        }
        let message = "zero".parse::<Invalid>().unwrap_err().to_string();
        assert!(
            message.contains("zero") && message.contains("drop"),
            "{message}"
        );
    }
}
