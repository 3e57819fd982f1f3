//! Writes the stress suite's records as JSON and as Markdown.

use std::fmt::Write as _;

use super::{Method, Precision, Record};

/// A list of objects, one per record; no value is ever NaN.
///
/// # Errors
/// What `serde_json` reports; nothing in a record provokes it.
pub fn json(records: &[Record]) -> serde_json::Result<String> {
    serde_json::to_string_pretty(records).map(|text| text + "\n")
}

/// Two tables: ratios to the oracle of all solvers, and what the default fit reported.
#[must_use]
pub fn markdown(records: &[Record], seeds: u64) -> String {
    let mut names: Vec<&str> = records.iter().map(|record| record.case).collect();
    names.dedup();
    let mut seen = Vec::new();
    names.retain(|name| !seen.contains(name) && (seen.push(*name), true).1);

    let find = |case: &str, method: Method, precision: Precision| {
        records.iter().find(|record| {
            (record.case, record.solver, record.precision) == (case, method.name(), precision)
        })
    };
    let ratio = |case: &str, method, precision| {
        find(case, method, precision).map_or_else(String::new, ratio_of)
    };
    let mut out = format!(
        "Test RMSE over the oracle's, median of {seeds} seeds; in brackets the worst of them. An empty \
         field: the solver does not apply.\n\n\
         | case | rows x neurons | inverse | pseudo-inverse | ridge 1e-6 | ridge gcv | **auto** | \
         pseudo-inverse, f32 | ridge gcv, f32 | **auto, f32** |\n|---|---|---|---|---|---|---|---|---|---|\n"
    );
    for case in &names {
        let Some(auto) = find(case, Method::Auto, Precision::F64) else {
            continue;
        };
        let [rows, neurons] = auto.shape;
        let mut line = format!("| {case} | {rows} x {neurons} |");
        for method in Method::ALL {
            let _ = write!(line, " {} |", ratio(case, method, Precision::F64));
        }
        for method in [Method::PseudoInverse, Method::Gcv, Method::Auto] {
            let _ = write!(line, " {} |", ratio(case, method, Precision::F32));
        }
        out += &line;
        out.push('\n');
    }
    out += "\nWhat `auto` reported at seed 1 (its first output), and how far the test predictions were \
            from the double-double reference, relative to their norm.\n\n\
            | case | rank | condition | lambda | degrees of freedom | route | error of auto | \
            of pseudo-inverse | of auto, f32 |\n|---|---|---|---|---|---|---|---|---|\n";
    for case in &names {
        let auto = find(case, Method::Auto, Precision::F64);
        let Some(report) = auto.and_then(|record| record.report.as_ref()) else {
            continue;
        };
        let count = |value: Option<usize>| value.map_or_else(String::new, |v| v.to_string());
        let error = |method, precision| {
            find(case, method, precision)
                .and_then(|record| record.reference_error)
                .map_or_else(String::new, |error| format!("{error:.0e}"))
        };
        let _ = writeln!(
            out,
            "| {case} | {} | {} | {:.0e} | {:.1} | {} | {} | {} | {} |",
            count(report.rank),
            report
                .condition
                .map_or_else(String::new, |c| format!("{c:.0e}")),
            report.lambda,
            report.degrees_of_freedom,
            format!("{:?}", report.route).to_lowercase(),
            error(Method::Auto, Precision::F64),
            error(Method::PseudoInverse, Precision::F64),
            error(Method::Auto, Precision::F32),
        );
    }
    out
}

fn ratio_of(record: &Record) -> String {
    match (record.ratio_to_oracle, record.worst_ratio) {
        (Some(ratio), Some(worst)) => format!("{} ({})", short(ratio), short(worst)),
        _ if record.error.is_some() => "error".to_owned(),
        _ => "-".to_owned(),
    }
}

fn short(ratio: f64) -> String {
    if ratio < 100.0 {
        format!("{ratio:.2}")
    } else {
        format!("{ratio:.0e}")
    }
}

/// The document with what stands between the markers `<!-- stress NAME -->` and
/// `<!-- end of stress NAME -->` replaced; without the markers the section is appended.
#[must_use]
pub fn replace_section(document: &str, name: &str, text: &str) -> String {
    let (begin, end) = (
        format!("<!-- stress {name} -->\n"),
        format!("<!-- end of stress {name} -->\n"),
    );
    let section = format!("{begin}\n{text}\n{end}");
    let parts = document.split_once(&begin).and_then(|(before, rest)| {
        let (_, after) = rest.split_once(&end)?;
        Some((before, after))
    });
    match parts {
        Some((before, after)) => format!("{before}{section}{after}"),
        None if document.is_empty() => section,
        None => format!("{document}\n{section}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_replaced_and_the_rest_is_kept() {
        let document = replace_section("# Title\n", "faer", "old");
        let other = replace_section(&document, "openblas", "other");
        let updated = replace_section(&other, "faer", "new");
        assert!(updated.starts_with("# Title\n"));
        assert!(updated.contains("new") && !updated.contains("old") && updated.contains("other"));
        assert_eq!(replace_section(&updated, "faer", "new"), updated);
    }
}
