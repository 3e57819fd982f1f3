//! The example `csv` on tables as users bring them.

use std::path::PathBuf;

#[allow(dead_code)] // Its `main`.
#[path = "../../examples/csv.rs"]
mod example;

struct Files(tempfile::TempDir);

impl Files {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, text: &str) -> String {
        let path: PathBuf = self.0.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }
}

fn run(arguments: &[&str]) -> Result<serde_json::Value, String> {
    let arguments = arguments.iter().map(|&argument| argument.to_owned());
    let report = example::run(arguments).map_err(|error| error.to_string())?;
    Ok(serde_json::from_str(&report).unwrap())
}

/// `price` from `rooms`, a whole number, and `area`; a constant column beside them.
fn table(header: [&str; 4], order: [usize; 4], rows: std::ops::Range<u32>) -> String {
    let mut text = order.map(|column| header[column]).join(",") + "\n";
    for i in rows {
        let (rooms, area) = (i % 7 + 1, 20.0 + f64::from(i * 37 % 101));
        let price = 1000.0 * area + 5000.0 * f64::from(rooms);
        let cells = [
            rooms.to_string(),
            area.to_string(),
            "3".to_owned(),
            price.to_string(),
        ];
        text += &(order.map(|column| cells[column].clone()).join(",") + "\n");
    }
    text
}

const HEADER: [&str; 4] = ["rooms", "area", "floor", "price"];

#[test]
fn it_reports_five_figures_wherever_the_target_stands_and_in_whatever_order_the_test_columns_are() {
    let files = Files::new();
    let train = files.write("train.csv", &table(HEADER, [0, 1, 2, 3], 0..60));
    let mut reports = Vec::new();
    for (number, order) in [[0, 1, 2, 3], [3, 2, 1, 0], [1, 3, 0, 2]]
        .into_iter()
        .enumerate()
    {
        let test = files.write(&format!("{number}.csv"), &table(HEADER, order, 60..90));
        reports.push(run(&[&train, &test, "--target", "price"]).unwrap());
    }
    assert_eq!(reports[0], reports[1]);
    assert_eq!(reports[0], reports[2]);
    let report = reports[0].as_object().unwrap();
    let figures = ["lambda", "loo_rmse", "neurons", "scale", "test_rmse"];
    assert_eq!(report.keys().collect::<Vec<_>>(), figures);
    assert!(report.values().all(serde_json::Value::is_number));
    // Prices spread over 30,000; the function is a plane.
    assert!(report["test_rmse"].as_f64().unwrap() < 300.0, "{report:?}");
}

#[test]
fn the_flag_may_stand_anywhere() {
    let files = Files::new();
    let train = files.write("train.csv", &table(HEADER, [3, 1, 2, 0], 0..20));
    let expected = run(&[&train, &train, "--target", "price"]).unwrap();
    assert_eq!(
        run(&["--target", "price", &train, &train]).unwrap(),
        expected
    );
    assert_eq!(run(&[&train, "--target=price", &train]).unwrap(), expected);
}

#[test]
fn what_is_wrong_is_said_in_one_line_that_names_it() {
    let files = Files::new();
    let good = files.write("good.csv", &table(HEADER, [0, 1, 2, 3], 0..20));
    let text = files.write("text.csv", "rooms,area,floor,price\n1,2,ground,4\n");
    let headless = files.write("headless.csv", "1,2\n3,4\n");
    let empty = files.write("empty.csv", "");
    let narrow = files.write("narrow.csv", "rooms,price\n1,2\n");
    let ragged = files.write("ragged.csv", "rooms,area,floor,price\n1,2\n");
    let blank = files.write("blank.csv", "rooms,area,floor,price\n1,,2,3\n");
    let only = files.write("only.csv", "price\n1\n2\n");
    for (arguments, fragments) in [
        (vec![], vec!["usage"]),
        (vec![good.as_str(), "--target", "price"], vec!["usage"]),
        (vec![&good, &good, "--target"], vec!["--target"]),
        (
            vec![&good, &good, "--goal", "price"],
            vec!["--goal", "usage"],
        ),
        (
            vec![&good, &good, "--target", "cost"],
            vec!["cost", "rooms"],
        ),
        (
            vec!["nowhere.csv", &good, "--target", "price"],
            vec!["nowhere.csv"],
        ),
        (
            vec![&good, "nowhere.csv", "--target", "price"],
            vec!["nowhere.csv"],
        ),
        (
            vec![&text, &good, "--target", "price"],
            vec!["text.csv", "ground", "floor"],
        ),
        (
            vec![&good, &text, "--target", "price"],
            vec!["text.csv", "ground", "floor"],
        ),
        (
            vec![&headless, &good, "--target", "price"],
            vec!["headless.csv"],
        ),
        (vec![&empty, &good, "--target", "price"], vec!["empty.csv"]),
        (
            vec![&good, &narrow, "--target", "price"],
            vec!["narrow.csv", "area"],
        ),
        (
            vec![&ragged, &good, "--target", "price"],
            vec!["ragged.csv"],
        ),
        (
            vec![&blank, &good, "--target", "price"],
            vec!["blank.csv", "area"],
        ),
        (vec![&only, &only, "--target", "price"], vec!["column"]),
    ] {
        let error = run(&arguments).unwrap_err();
        assert!(!error.contains('\n'), "{error}");
        for fragment in fragments {
            assert!(error.contains(fragment), "{arguments:?}: {error}");
        }
    }
}
