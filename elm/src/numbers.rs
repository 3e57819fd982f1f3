//! Infinity and NaN in JSON files, which have neither.

use serde::ser::{Error as _, Serializer};
use serde::{Deserialize, Deserializer, Serialize};

/// Writes a number, or refuses one that is not finite.
pub(crate) fn finite<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        value.serialize(serializer)
    } else {
        Err(S::Error::custom(format_args!(
            "{value} cannot be written to a file"
        )))
    }
}

/// As [`finite`], for a number that may be absent.
pub(crate) fn finite_if_any<S: Serializer>(
    value: &Option<f64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match value {
        Some(value) if !value.is_finite() => finite(value, serializer),
        value => value.serialize(serializer),
    }
}

/// A score, which is infinite where there is none: `null` where people read it.
pub(crate) mod score {
    use super::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(score: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            score.is_finite().then_some(score).serialize(serializer)
        } else {
            score.serialize(serializer)
        }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        if deserializer.is_human_readable() {
            let score = Option::deserialize(deserializer)?;
            Ok(score.unwrap_or(f64::INFINITY))
        } else {
            f64::deserialize(deserializer)
        }
    }
}
