//! Damaged folders: each is refused with the file, the line and what was expected; harmless
//! variations are not.

use std::f64::consts::TAU;
use std::fs;

use crate::support::{all, change, synthetic_folder};
use elm_datasets::error::Layout;
use elm_datasets::{Angles, Error, Invalid, MaterialId, Origin, curet, synthetic};

/// An edit of a file's lines, without their ends.
type Edit = fn(&mut Vec<String>);

/// What is damaged, the file, the edit, and what the message must contain beside the file.
#[rustfmt::skip]
const DAMAGE: &[(&str, &str, Edit, &[&str])] = &[
    ("value missing", "rbrdf.dat", |l| { let end = l[6].len() - 8; l[6].truncate(end); }, &["line 7", "expected 206 numbers", "found 205"]),
    ("value too many", "gbrdf.dat", |l| l[60].push_str(" 0.1"), &["line 61", "expected 206 numbers", "found 207"]),
    ("number alone", "bbrdf.dat", |l| l[0] = "1".into(), &["line 1", "expected 206 numbers", "found 1"]),
    ("angle missing", "table.txt", |l| l[204] = "205 1.0 0.0 1.0".into(), &["line 205", "expected 5 numbers", "found 4"]),
    ("last line missing", "rbrdf.dat", |l| { l.pop(); }, &["material 61 is missing", "line 60", "1 to 61"]),
    ("middle line missing", "rbrdf.dat", |l| { l.remove(9); }, &["material 10 is missing", "line 60"]),
    ("measurement missing", "table.txt", |l| { l.remove(99); }, &["measurement 100 is missing", "line 204", "1 to 205"]),
    ("empty value file", "rbrdf.dat", Vec::clear, &["material 1 is missing", "line 0"]),
    ("empty table", "table.txt", Vec::clear, &["measurement 1 is missing", "line 0"]),
    ("material twice", "gbrdf.dat", |l| l[4] = l[2].clone(), &["line 5", "material 3", "line 3", "once"]),
    ("measurement twice", "table.txt", |l| l.push("7 1 1 1 1".into()), &["line 206", "measurement 7", "line 7"]),
    ("material 62", "gbrdf.dat", |l| l.push("62 0.1".into()), &["line 62", "number of a material (1 to 61)", "\"62\""]),
    ("material 0", "gbrdf.dat", |l| l[0].replace_range(..1, "0"), &["line 1", "1 to 61", "\"0\""]),
    ("material -1", "gbrdf.dat", |l| l[0].insert(0, '-'), &["line 1", "1 to 61", "\"-1\""]),
    ("measurement 206", "table.txt", |l| l.push("206 1 1 1 1".into()), &["line 206", "measurement (1 to 205)", "\"206\""]),
    ("number not whole", "table.txt", |l| l[1].replace_range(..1, "2.5"), &["line 2", "1 to 205", "\"2.5\""]),
    ("blank line between", "rbrdf.dat", |l| l.insert(3, " ".into()), &["line 4", "1 to 61", "\"\""]),
    ("blank line first", "rbrdf.dat", |l| l.insert(0, String::new()), &["line 1:", "1 to 61", "\"\""]),
    ("first line a heading", "rbrdf.dat", |l| l.insert(0, "values".into()), &["line 1", "\"values\""]),
    ("a word among values", "bbrdf.dat", |l| word(&mut l[1], 3, "O.1"), &["line 2", "number 4", "finite number", "\"O.1\""]),
    ("a decimal comma", "bbrdf.dat", |l| word(&mut l[1], 205, "0,1"), &["line 2", "number 206", "\"0,1\""]),
    ("not a number", "bbrdf.dat", |l| word(&mut l[1], 1, "NaN"), &["line 2", "number 2", "\"NaN\""]),
    ("infinite", "bbrdf.dat", |l| word(&mut l[60], 1, "-inf"), &["line 61", "number 2", "\"-inf\""]),
    ("overflowing", "bbrdf.dat", |l| word(&mut l[60], 1, "1e999"), &["line 61", "\"1e999\""]),
    ("angle not a number", "table.txt", |l| word(&mut l[3], 4, "x"), &["line 4", "number 5", "\"x\""]),
    ("viewer at the horizon", "table.txt", |l| word(&mut l[3], 1, "1.570797"), &["line 4", "theta_o in [0, pi/2)", "1.570797"]),
    ("light below zero", "table.txt", |l| word(&mut l[3], 3, "-0.1"), &["line 4", "theta_i in [0, pi/2)", "-0.1"]),
    ("degrees", "table.txt", |l| word(&mut l[8], 2, "-90.0"), &["line 9", "phi_o in [-2 pi, 2 pi]", "-90"]),
    ("azimuth beyond a turn", "table.txt", |l| word(&mut l[8], 4, "6.2832"), &["line 9", "phi_i in [-2 pi, 2 pi]", "6.2832"]),
];

/// Replaces a word of a line, counted from 0.
fn word(line: &mut String, index: usize, new: &str) {
    let mut words: Vec<&str> = line.split_whitespace().collect();
    words[index] = new;
    *line = words.join("  ");
}

fn edit_lines(bytes: Vec<u8>, edit: impl FnOnce(&mut Vec<String>), end: &str) -> Vec<u8> {
    let text = String::from_utf8(bytes).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    edit(&mut lines);
    lines.join(end).into_bytes()
}

#[test]
fn damage_is_reported_with_file_line_and_expectation() {
    let dir = synthetic_folder();
    for (what, file, edit, fragments) in DAMAGE {
        let whole = fs::read(dir.path().join(file)).unwrap();
        change(dir.path(), file, |bytes| edit_lines(bytes, edit, "\n"));
        let Err(error) = curet::read(dir.path(), &all(), Invalid::Clamp) else {
            panic!("{what}: read without an error");
        };
        let message = error.to_string();
        for fragment in fragments.iter().chain([file]) {
            assert!(
                message.contains(fragment),
                "{what}: no {fragment:?} in {message:?}"
            );
        }
        assert!(
            !message.contains('\n') && message.len() < 400,
            "{what}: {message}"
        );
        fs::write(dir.path().join(file), whole).unwrap();
    }
    assert!(curet::read(dir.path(), &all(), Invalid::Clamp).is_ok());
}

#[test]
fn single_files_are_checked_as_a_folder_is() {
    let dir = synthetic_folder();
    for (what, file, edit, fragments) in DAMAGE {
        let whole = fs::read(dir.path().join(file)).unwrap();
        let check = |bytes: &[u8]| match *file {
            curet::TABLE => curet::parse_table(bytes, file).map(|_| ()),
            _ => curet::parse_values(bytes, file).map(|_| ()),
        };
        check(&whole).unwrap();
        let message = check(&edit_lines(whole, edit, "\n"))
            .unwrap_err()
            .to_string();
        for fragment in fragments.iter().chain([file]) {
            assert!(message.contains(fragment), "{what}: {message}");
        }
    }
    assert_eq!(curet::VALUES.len(), 4);
}

#[test]
fn bytes_that_are_not_text_are_reported_with_their_line() {
    for (file, line, at) in [("rbrdf.dat", 3, 20), ("table.txt", 2, 0)] {
        let dir = synthetic_folder();
        change(dir.path(), file, |mut bytes| {
            let starts = bytes
                .iter()
                .enumerate()
                .filter(|&(_, &b)| b == b'\n')
                .map(|(i, _)| i + 1);
            let start = starts.collect::<Vec<_>>()[line - 2];
            bytes[start + at] = 0xff;
            bytes
        });
        let error = curet::read(dir.path(), &all(), Invalid::Clamp).unwrap_err();
        let Error::NotUtf8 { path, line: found } = &error else {
            panic!("{error}")
        };
        assert_eq!((path, *found), (&dir.path().join(file), line));
    }
}

#[test]
fn line_ends_trailing_blanks_order_and_blank_lines_at_the_end_do_not_matter() {
    let dir = synthetic_folder();
    let expected = curet::read(dir.path(), &all(), Invalid::Keep).unwrap();
    let variations: [(&str, Edit, &str); 5] = [
        ("LF", |_| {}, "\n"),
        ("another order", |l| l.reverse(), "\n"),
        ("CRLF", |_| {}, "\r\n"),
        (
            "trailing blanks",
            |l| l.iter_mut().for_each(|line| line.push_str(" \t ")),
            "\n",
        ),
        (
            "blank lines at the end",
            |l| l.extend(["", " ", "", ""].map(String::from)),
            "\r\n",
        ),
    ];
    for (what, edit, end) in variations {
        for file in ["table.txt", "rbrdf.dat", "gbrdf.dat", "bbrdf.dat"] {
            change(dir.path(), file, |bytes| edit_lines(bytes, edit, end));
        }
        assert_eq!(
            curet::read(dir.path(), &all(), Invalid::Keep).unwrap(),
            expected,
            "{what}"
        );
    }
}

#[test]
fn damage_to_materials_not_asked_for_is_not_looked_at() {
    let dir = synthetic_folder();
    change(dir.path(), "rbrdf.dat", |bytes| {
        edit_lines(bytes, |l| word(&mut l[4], 9, "x"), "\n")
    });
    let ids = |number| [MaterialId::new(number).unwrap()];
    assert!(curet::read(dir.path(), &ids(4), Invalid::Clamp).is_ok());
    assert!(curet::read(dir.path(), &ids(5), Invalid::Clamp).is_err());
}

#[test]
fn a_folder_without_a_complete_set_says_what_was_looked_for_and_found() {
    let dir = synthetic_folder();
    let message = || {
        curet::read(dir.path(), &all(), Invalid::Clamp)
            .unwrap_err()
            .to_string()
    };
    assert!(curet::is_present(dir.path()));
    fs::remove_file(dir.path().join("bbrdf.dat")).unwrap();
    assert!(!curet::is_present(dir.path()));
    for fragment in [
        &dir.path().display().to_string(),
        "abrdf.dat",
        "found rbrdf.dat, gbrdf.dat",
    ] {
        assert!(message().contains(fragment), "{}", message());
    }
    fs::copy(dir.path().join("rbrdf.dat"), dir.path().join("abrdf.dat")).unwrap();
    let set = curet::read(dir.path(), &all(), Invalid::Clamp).unwrap();
    assert_eq!(set.channels, ["average"]);
    fs::remove_file(dir.path().join("table.txt")).unwrap();
    assert!(!curet::is_present(dir.path()));
    assert!(message().starts_with("cannot read") && message().contains("table.txt"));
    let nowhere = dir.path().join("nowhere");
    let error = curet::read(&nowhere, &all(), Invalid::Clamp).unwrap_err();
    assert!(error.to_string().ends_with("found none"), "{error}");
}

#[test]
fn what_is_written_is_read_back() {
    for invalid in [Invalid::Keep, Invalid::Clamp] {
        let dir = tempfile::tempdir().unwrap();
        let made = synthetic::measurements(9, &all(), invalid);
        curet::write(&dir.path().join("a/b"), &made).unwrap();
        let read = curet::read(&dir.path().join("a/b"), &all(), Invalid::Keep).unwrap();
        assert_eq!((read.origin, read.channels), (Origin::Curet, made.channels));
        for (a, b) in read.materials.iter().zip(&made.materials) {
            assert_eq!((a.id, &a.values, &a.rows), (b.id, &b.values, &b.rows));
        }
        for (a, b) in read.directions.iter().zip(&made.directions) {
            let (a, b) = (Angles::of(a), Angles::of(b));
            for (a, b) in [
                (a.theta_i, b.theta_i),
                (a.phi_i, b.phi_i),
                (a.theta_o, b.theta_o),
                (a.phi_o, b.phi_o),
            ] {
                // Half a turn is the same in either direction.
                let turned = (a - b).rem_euclid(TAU);
                assert!(turned.min(TAU - turned) <= 5.001e-7);
            }
        }
    }
}

#[test]
fn what_does_not_fit_the_layout_is_not_written() {
    let dir = tempfile::tempdir().unwrap();
    let whole = synthetic::measurements(1, &all(), Invalid::Keep);
    let refused = |set: &elm_datasets::Measurements| match curet::write(dir.path(), set) {
        Err(Error::Layout(layout)) => layout,
        other => panic!("{other:?}"),
    };
    let mut set = whole.clone();
    set.materials.remove(6);
    assert!(matches!(
        refused(&set),
        Layout::Materials {
            number: 7,
            count: 0,
            ..
        }
    ));
    let mut set = whole.clone();
    set.materials.push(set.materials[3].clone());
    assert!(matches!(
        refused(&set),
        Layout::Materials {
            number: 4,
            count: 2,
            ..
        }
    ));
    let set = synthetic::measurements(1, &all(), Invalid::Drop);
    assert!(matches!(refused(&set), Layout::Rows { number: 61, .. }));
    let mut set = whole.clone();
    set.directions.pop();
    assert!(matches!(
        refused(&set),
        Layout::Directions { found: 204, .. }
    ));
    let mut set = whole.clone();
    set.directions[4].outgoing[0] = f64::NAN;
    assert!(matches!(
        refused(&set),
        Layout::Angle {
            measurement: 5,
            angle: "theta_o",
            ..
        }
    ));
    let mut set = whole.clone();
    set.channels.swap(0, 2);
    assert!(matches!(refused(&set), Layout::Channels(_)));
    let mut set = whole.clone();
    set.materials[1].values[[8, 2]] = f64::INFINITY;
    assert!(matches!(
        refused(&set),
        Layout::NotFinite {
            number: 2,
            measurement: 9,
            ..
        }
    ));
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn large_values_stay_apart_in_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let mut set = synthetic::measurements(1, &all(), Invalid::Keep);
    for (row, value) in [(0, 12345.678), (1, -98765.432), (2, 1e15)] {
        set.materials[1].values[[row, 0]] = value;
    }
    curet::write(dir.path(), &set).unwrap();
    let read = curet::read(dir.path(), &all(), Invalid::Keep).unwrap();
    assert_eq!(read.materials[1].values, set.materials[1].values);
}
