//! What separates the numbers of a table, and which of its lines are comments.
//!
//! A table is rewritten with commas between and points in its numbers, byte for byte, so that a line of the
//! rewritten text is that line of the file.

use super::names;
use crate::error::scattered::AngleUnit;

/// What begins a comment.
const MARKS: [&str; 4] = ["#", "%", "!", "//"];
/// Lines that may stand before the names of the columns.
const PREAMBLE: usize = 100;

/// A table as it is read.
#[derive(Debug)]
pub(super) struct Text {
    /// Commas between, points in numbers, comments blank; as long as the file.
    pub(super) bytes: Vec<u8>,
    pub(super) separator: Separator,
    /// Lines before the names and comments after them that were passed over.
    pub(super) comments: usize,
    /// The unit of the angles by what these lines say, if they say one.
    pub(super) unit: Option<AngleUnit>,
    /// Whether numbers have a comma where others have a point.
    pub(super) decimal_commas: bool,
}

/// What stands between two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    Comma,
    Semicolon,
    Tab,
    Blanks,
}

impl Separator {
    /// What separates the words of a header: the first by which two of them name directions. Not that by
    /// which most do: the name of a column of values may hold any number of such words.
    fn of(header: &str) -> Self {
        let named = |separator: &Self| {
            let cells = separator.cells(header);
            cells
                .iter()
                .filter(|cell| names::of(cell).is_some())
                .count()
        };
        let mut all = [Self::Comma, Self::Semicolon, Self::Tab, Self::Blanks].into_iter();
        let enough = all.clone().find(|separator| named(separator) >= 2);
        enough
            .or_else(|| all.find(|separator| named(separator) > 0))
            .unwrap_or(Self::Comma)
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Comma => "commas",
            Self::Semicolon => "semicolons",
            Self::Tab => "tabs",
            Self::Blanks => "blanks",
        }
    }

    pub(super) fn cells(self, line: &str) -> Vec<&str> {
        match self {
            Self::Comma => line.split(',').collect(),
            Self::Semicolon => line.split(';').collect(),
            Self::Tab => line.split('\t').collect(),
            Self::Blanks => line.split_whitespace().collect(),
        }
    }

    fn is(self, c: char) -> bool {
        match self {
            Self::Comma => c == ',',
            Self::Semicolon => c == ';',
            Self::Tab => c == '\t',
            Self::Blanks => c == ' ' || c == '\t',
        }
    }
}

/// The line without the mark of a comment, if it has one.
fn comment(line: &str) -> Option<&str> {
    let line = line.trim_start();
    MARKS.iter().find_map(|mark| line.strip_prefix(mark))
}

/// Whether at least two columns of a line name directions.
pub(super) fn is_header(line: &str) -> bool {
    let cells = Separator::of(line).cells(line);
    cells
        .iter()
        .filter(|cell| names::of(cell).is_some())
        .count()
        >= 2
}

/// The unit that words say, where they say one.
fn unit_of(text: &str) -> Option<AngleUnit> {
    let lower = text.to_lowercase();
    let is_letter = |c: char| c.is_alphabetic() || c == '\u{b0}';
    let has = |list: &[&str]| {
        lower
            .split(|c| !is_letter(c))
            .any(|word| list.contains(&word))
    };
    let degrees = has(&["degrees", "degree", "deg", "\u{b0}"]);
    let radians = has(&["radians", "radian", "rad"]);
    match (degrees, radians) {
        (true, false) => Some(AngleUnit::Degrees),
        (false, true) => Some(AngleUnit::Radians),
        _ => None,
    }
}

impl Text {
    /// `None` for bytes that need no rewriting: a table with commas and without comments, or no text.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        let text = std::str::from_utf8(bytes).ok()?;
        let start = text
            .strip_prefix('\u{feff}')
            .map_or(0, |_| '\u{feff}'.len_utf8());
        let header = header(&text[start..])?;
        let named = &text[start..][header.clone()];
        let separator = Separator::of(comment(named).unwrap_or(named));
        let around = [&text[start..][..header.start], &text[start..][header.end..]];
        let commented = comment(named).is_some()
            || !around[0].trim().is_empty()
            || around[1].lines().any(|line| comment(line).is_some());
        if separator == Separator::Comma && !commented {
            return None;
        }
        let mut out = Self {
            bytes: bytes.to_vec(),
            separator,
            comments: 0,
            unit: None,
            decimal_commas: false,
        };
        let mut said = String::new();
        let mut quoted = false;
        let mut at = start;
        for line in text[start..].split_inclusive('\n') {
            let content = line.trim_end_matches(['\r', '\n']);
            let end = at + content.len();
            let is_named = at == start + header.start;
            if is_named {
                if let Some(rest) = comment(content) {
                    out.bytes[at..end - rest.len()].fill(b' ');
                }
                quoted = out.separate(at..end, quoted);
            } else if at < start + header.start || !quoted && comment(content).is_some() {
                if !content.trim().is_empty() {
                    out.comments += 1;
                    said.push_str(content);
                    said.push('\n');
                }
                // Lines without anything, which a table may have.
                out.bytes[at..end].fill(b'\r');
            } else {
                quoted = out.separate(at..end, quoted);
            }
            at += line.len();
        }
        out.unit = unit_of(&said);
        Some(out)
    }

    /// Puts commas between the cells of a line, and points into its numbers. Whether the line begins, and
    /// ends, within quotes is given and returned.
    fn separate(&mut self, range: std::ops::Range<usize>, mut quoted: bool) -> bool {
        if self.separator == Separator::Comma {
            let quotes = self.bytes[range]
                .iter()
                .filter(|&&byte| byte == b'"')
                .count();
            return quoted != (quotes % 2 == 1);
        }
        let mut line = self.bytes[range.clone()].to_vec();
        let mut cell = 0;
        for at in 0..=line.len() {
            let byte = line.get(at).copied();
            if byte == Some(b'"') {
                quoted = !quoted;
            }
            let ends = byte.is_none_or(|b| !quoted && self.separator.is(char::from(b)));
            if !ends {
                continue;
            }
            self.decimal_commas |= point(&mut line[cell..at]);
            if byte.is_some() {
                // Of several blanks one separates, and none before the first cell or after the last.
                let blanks = self.separator == Separator::Blanks;
                let empty = line[cell..at].trim_ascii().is_empty();
                let last = line[at..].trim_ascii().is_empty();
                line[at] = if blanks && (empty || last) {
                    b' '
                } else {
                    b','
                };
                cell = at + 1;
            }
        }
        self.bytes[range].copy_from_slice(&line);
        quoted
    }
}

/// Writes a number with a comma with a point, and blanks into any other cell with commas; whether it
/// was such a number.
fn point(cell: &mut [u8]) -> bool {
    if !cell.contains(&b',') {
        return false;
    }
    let with_point: Vec<u8> = cell
        .iter()
        .map(|&b| if b == b',' { b'.' } else { b })
        .collect();
    let text = std::str::from_utf8(&with_point).unwrap_or_default();
    let is_number = text.trim().parse::<f64>().is_ok();
    let quoted = cell.trim_ascii().starts_with(b"\"");
    if is_number {
        cell.copy_from_slice(&with_point);
    } else if !quoted {
        let blank = |byte: &mut u8| {
            if *byte == b',' {
                *byte = b' ';
            }
        };
        cell.iter_mut().for_each(blank);
    }
    is_number
}

/// Where the line of names is: the first that names directions, be it a comment; else the first that
/// is no comment, if there are comments before it.
fn header(text: &str) -> Option<std::ops::Range<usize>> {
    let mut at = 0;
    let mut first = None;
    for line in text.split_inclusive('\n').take(PREAMBLE) {
        let content = line.trim_end_matches(['\r', '\n']);
        let range = at..at + content.len();
        at += line.len();
        if content.trim().is_empty() {
            continue;
        }
        let bare = comment(content);
        if is_header(bare.unwrap_or(content)) {
            return Some(range);
        }
        if bare.is_none() && first.is_none() {
            first = Some(range);
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rewritten(text: &str) -> String {
        let found = Text::of(text.as_bytes()).unwrap();
        assert_eq!(found.bytes.len(), text.len());
        String::from_utf8(found.bytes).unwrap()
    }

    #[test]
    fn tables_are_rewritten_byte_for_byte() {
        for (text, expected) in [
            (
                "theta_i\tphi_i\tbrdf\n1\t2\t3\n",
                "theta_i,phi_i,brdf\n1,2,3\n",
            ),
            (
                "theta_i;phi_i;\"a;b\"\n1,5;2;3e-1\n",
                "theta_i,phi_i,\"a;b\"\n1.5,2,3e-1\n",
            ),
            (" theta_i   phi_i \n 1  2 \n", " theta_i,  phi_i \n 1, 2 \n"),
            (
                "# of it\ntheta_i,phi_i\n# more\n1,2\n",
                "\r\r\r\r\r\r\r\ntheta_i,phi_i\n\r\r\r\r\r\r\n1,2\n",
            ),
            ("# theta_i phi_i v\n1 2 3\n", "  theta_i,phi_i,v\n1,2,3\n"),
            (
                "theta_i\tphi_i\tfor SZA VZA RAA\n1\t2\t3\n",
                "theta_i,phi_i,for SZA VZA RAA\n1,2,3\n",
            ),
            (
                "Made by hand\n\ntheta_i,phi_i\n1,2\n",
                "\r\r\r\r\r\r\r\r\r\r\r\r\n\ntheta_i,phi_i\n1,2\n",
            ),
        ] {
            assert_eq!(rewritten(text), expected, "{text:?}");
        }
    }

    #[test]
    fn plain_tables_are_not_copied() {
        assert!(Text::of(b"theta_i,phi_i\n1,2\n").is_none());
        // Whatever the name of a column of values says.
        assert!(Text::of(b"theta_i,phi_i,for SZA VZA RAA\n1,2,3\n").is_none());
    }

    #[test]
    fn comments_say_the_unit_if_they_say_one() {
        for (text, unit) in [
            ("# angles in degrees\n", Some(AngleUnit::Degrees)),
            ("# [rad]\n", Some(AngleUnit::Radians)),
            ("# theta in deg, phi in rad\n", None),
            ("# nothing\n", None),
        ] {
            let text = format!("{text}theta_i,phi_i\n1,2\n");
            assert_eq!(Text::of(text.as_bytes()).unwrap().unit, unit, "{text:?}");
        }
    }
}
