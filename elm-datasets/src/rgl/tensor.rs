//! The container of RGL's files: named arrays of numbers, little-endian.
//!
//! | bytes | content |
//! |---|---|
//! | 12 | `tensor_file` and a zero |
//! | 2 | version, 1 and 0 |
//! | 4 | number of fields |
//! | per field 2 + n | length of the name, and the name |
//! | 2, 1, 8 | number of dimensions, type, byte at which the numbers begin |
//! | 8 each | sizes of the dimensions, the last running fastest |

use crate::error::rgl::Problem;
use crate::text::shorten;

pub(super) const MAGIC: &[u8; 12] = b"tensor_file\0";
const VERSION: [u8; 2] = [1, 0];
pub(super) const U8: u8 = 1;
pub(super) const F32: u8 = 10;
/// Bytes per number of each type, by its code: none, four pairs of integers, three floats.
const WIDTHS: [usize; 12] = [0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8];

/// An array as it stands in the file.
#[derive(Debug)]
pub(super) struct Field<'a> {
    pub(super) name: &'a str,
    pub(super) code: u8,
    pub(super) shape: Vec<u64>,
    pub(super) bytes: &'a [u8],
}

impl Field<'_> {
    /// The numbers, if they are of 32-bit floating point.
    pub(super) fn floats(&self) -> impl Iterator<Item = f32> + '_ {
        let words = self.bytes.as_chunks::<4>().0.iter();
        words.map(|&bytes| f32::from_le_bytes(bytes))
    }
}

/// All fields of a file. Nothing is allocated that the file has no bytes for.
pub(super) fn fields(bytes: &[u8]) -> Result<Vec<Field<'_>>, Problem> {
    let mut cursor = Cursor { bytes, at: 0 };
    if bytes.get(..MAGIC.len()) != Some(MAGIC) {
        return Err(Problem::NoTensorFile);
    }
    cursor.at = MAGIC.len();
    let found = cursor.array::<2>()?;
    if found != VERSION {
        return Err(Problem::Version { found });
    }
    let count = u32::from_le_bytes(cursor.array()?);
    let mut fields = Vec::new();
    for _ in 0..count {
        fields.push(field(&mut cursor)?);
    }
    Ok(fields)
}

fn field<'a>(cursor: &mut Cursor<'a>) -> Result<Field<'a>, Problem> {
    let at = cursor.at;
    let length = u16::from_le_bytes(cursor.array()?);
    let name = std::str::from_utf8(cursor.take(length.into())?)
        .map_err(|_| Problem::FieldName { at: at as u64 })?;
    let dimensions = u16::from_le_bytes(cursor.array()?);
    let [code] = cursor.array()?;
    let offset = u64::from_le_bytes(cursor.array()?);
    let width = match WIDTHS.get(usize::from(code)) {
        Some(&width) if width > 0 => width as u64,
        _ => {
            return Err(Problem::FieldType {
                field: shorten(name),
                found: code,
            });
        }
    };
    let mut shape = Vec::new();
    for _ in 0..dimensions {
        shape.push(u64::from_le_bytes(cursor.array()?));
    }
    let length = shape
        .iter()
        .try_fold(width, |product, &size| product.checked_mul(size));
    let bytes = slice(cursor.bytes, offset, length).ok_or_else(|| Problem::FieldData {
        field: shorten(name),
        offset,
        shape: shape.clone(),
        file: cursor.bytes.len() as u64,
    })?;
    Ok(Field {
        name,
        code,
        shape,
        bytes,
    })
}

fn slice(bytes: &[u8], offset: u64, length: Option<u64>) -> Option<&[u8]> {
    let end = offset.checked_add(length?)?;
    bytes.get(usize::try_from(offset).ok()?..usize::try_from(end).ok()?)
}

/// A place in a file.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Problem> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let Some(taken) = rest.get(..count) else {
            return Err(Problem::Truncated {
                at: self.at as u64,
                needed: count,
                left: rest.len(),
            });
        };
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Problem> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }
}
