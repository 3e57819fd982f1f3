//! Tables of numbers as CSV.

use std::fmt::Write as _;

use elm_datasets::csv::Table;

use super::{Reader, Seed, read};

pub(super) const TABLE: Reader = Reader {
    name: "table",
    seeds,
    read: |bytes| {
        let Some(table) = read(bytes, || Table::from_reader(bytes, "some.csv")) else {
            return false;
        };
        assert_eq!(table.columns.len(), table.values.ncols());
        assert!(table.values.nrows() > 0, "a table without rows");
        assert!(table.values.iter().all(|value| value.is_finite()));
        let again = Table::from_reader(text(&table).as_bytes(), "again.csv");
        assert_eq!(again.expect("what was written can be read"), table);
        if let [first, _, ..] = table.columns.as_slice() {
            let (x, t) = table
                .split_target(&[first])
                .expect("a column that is there");
            assert_eq!((x.ncols() + t.ncols(), t.ncols()), (table.columns.len(), 1));
        }
        true
    },
};

/// The table as CSV, all names in quotes.
fn text(table: &Table) -> String {
    let names = table
        .columns
        .iter()
        .map(|name| format!("\"{}\"", name.replace('"', "\"\"")));
    let mut text = names.collect::<Vec<_>>().join(",");
    for row in table.values.rows() {
        text.push('\n');
        for (column, value) in row.iter().enumerate() {
            let comma = if column > 0 { "," } else { "" };
            // Writing to a string cannot fail.
            let _ = write!(text, "{comma}{value:?}");
        }
    }
    text
}

fn seeds() -> Vec<Seed> {
    [
        ("plain.csv", "a,b\n1,-2.5\n3e2,0\n"),
        (
            "quoted.csv",
            " a ,\"b, \"\"c\"\"\"\r\n\r\n 1 , -2.5 \r\n\"3e2\",+0\r\n",
        ),
        ("mark.csv", "\u{feff}a\n1e-320\n"),
        ("bad-short.csv", "a,b,c\n1,2,3\n4,5\n"),
        ("bad-header.csv", "1,2\n3,4\n"),
    ]
    .map(|(name, text)| Seed {
        name,
        bytes: text.into(),
    })
    .into()
}
