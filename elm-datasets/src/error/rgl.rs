//! What can be wrong with a file of the RGL database.

/// What is wrong with a file that cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The file begins otherwise.
    #[error("at byte 0, expected \"tensor_file\", found other bytes")]
    NoTensorFile,
    /// A version of the container that is not known.
    #[error("at byte 12, expected version 1.0, found {}.{}", found[0], found[1])]
    Version {
        /// The version.
        found: [u8; 2],
    },
    /// The file ends within the description of its fields.
    #[error("at byte {at}, expected {needed} more bytes, found {left}")]
    Truncated {
        /// Place in the file.
        at: u64,
        /// Bytes expected there.
        needed: usize,
        /// Bytes left.
        left: usize,
    },
    /// A field whose name is not UTF-8.
    #[error("at byte {at}, expected the name of a field in UTF-8, found other bytes")]
    FieldName {
        /// Place of the field's description.
        at: u64,
    },
    /// A field of a type that is not known.
    #[error("field {field:?}: expected a type from 1 to 11, found {found}")]
    FieldType {
        /// Name of the field, shortened if long.
        field: String,
        /// Code of the type.
        found: u8,
    },
    /// A field whose numbers are not within the file.
    #[error(
        "field {field:?}: expected shape {} from byte {offset} to lie within the file's {file} \
         bytes",
        brief(shape)
    )]
    FieldData {
        /// Name of the field, shortened if long.
        field: String,
        /// Where its numbers begin.
        offset: u64,
        /// Sizes of its dimensions.
        shape: Vec<u64>,
        /// Length of the file in bytes.
        file: u64,
    },
    /// A field that is not there.
    #[error("expected a field {field:?}, found none")]
    NoField {
        /// Name of the field.
        field: &'static str,
    },
    /// A field of another type or shape.
    #[error(
        "field {field:?}: expected {expected}, found type {code} of shape {}",
        brief(shape)
    )]
    Layout {
        /// Name of the field.
        field: &'static str,
        /// What it must be.
        expected: &'static str,
        /// Code of the type found: 1 for bytes, 10 for 32-bit floating point.
        code: u8,
        /// Sizes of the dimensions found.
        shape: Vec<u64>,
    },
    /// A number that cannot stand there.
    #[error("field {field:?}, number {index}: expected {expected}, found {found}")]
    Number {
        /// Name of the field.
        field: &'static str,
        /// Place among the field's numbers, counted from 0.
        index: usize,
        /// What it must be.
        expected: &'static str,
        /// The number.
        found: f32,
    },
    /// A density that is zero everywhere.
    #[error("field \"vndf\", table {table}: expected a density, found zeros only")]
    NoDensity {
        /// Which of the tables, counted from 0.
        table: usize,
    },
    /// Azimuths of a material with a grain that no symmetry completes.
    #[error(
        "field \"phi_i\": expected azimuths that span a turn, half of one or a quarter, found {span:.1} degrees"
    )]
    Azimuths {
        /// From the first to the last, in degrees.
        span: f64,
    },
}

/// A shape for an error: a file may claim any number of dimensions.
fn brief(shape: &[u64]) -> String {
    const MAX: usize = 6;
    if shape.len() <= MAX {
        return format!("{shape:?}");
    }
    format!("{:?}... ({} dimensions)", &shape[..MAX], shape.len())
}
