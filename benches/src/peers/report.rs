//! Writes the comparison with other libraries as a table or as JSON.

use std::fmt::Write as _;

use clap::ValueEnum;
use serde::Serialize;

/// What was timed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// The fit of a network of the size's number of neurons.
    Fit,
    /// Prediction of 2000 rows together.
    PredictBatch,
    /// Prediction of a single row.
    PredictOne,
    /// The cheapest fit that reaches the peer's best error.
    TimeToError,
}

impl Task {
    fn name(self) -> &'static str {
        match self {
            Self::Fit => "fit",
            Self::PredictBatch => "predict_batch",
            Self::PredictOne => "predict_one",
            Self::TimeToError => "time_to_error",
        }
    }
}

/// One comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Record {
    /// The size's name.
    pub size: &'static str,
    /// The peer.
    pub peer: String,
    /// What was timed.
    pub task: Task,
    /// Median of the ratios of processor time, pair by pair.
    pub ours_over_peer: f64,
    /// Test error of ours.
    pub rmse_ours: f64,
    /// Test error of the peer.
    pub rmse_peer: f64,
    /// Of a fit, the ratio of peak memory, where the system says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_memory_ours_over_peer: Option<f64>,
}

/// How results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// A Markdown table for each task.
    Table,
    /// A list of records.
    Json,
}

/// The results as text.
///
/// # Errors
/// Those of the JSON writer.
pub fn print(records: &[Record], about: &str, format: Format) -> Result<String, serde_json::Error> {
    match format {
        Format::Json => serde_json::to_string_pretty(records),
        Format::Table => Ok(table(records, about)),
    }
}

fn table(records: &[Record], about: &str) -> String {
    let mut text = format!("Peers: {about}.\n");
    let mut line = |parts: std::fmt::Arguments<'_>| {
        // Writing to a string does not fail.
        let _ = text.write_fmt(parts);
    };
    for task in [
        Task::Fit,
        Task::TimeToError,
        Task::PredictBatch,
        Task::PredictOne,
    ] {
        let of_task: Vec<&Record> = records.iter().filter(|r| r.task == task).collect();
        if of_task.is_empty() {
            continue;
        }
        let fit = task == Task::Fit;
        line(format_args!("\n### {}\n\n", task.name()));
        line(format_args!(
            "| size | peer | time, ours / peer | RMSE, ours | RMSE, peer |"
        ));
        line(format_args!(
            "{}",
            if fit {
                " peak memory, ours / peer |\n"
            } else {
                "\n"
            }
        ));
        line(format_args!(
            "|---|---|---|---|---|{}",
            if fit { "---|\n" } else { "\n" }
        ));
        for r in of_task {
            let better = if r.rmse_peer < 0.99 * r.rmse_ours {
                " (peer)"
            } else {
                ""
            };
            line(format_args!(
                "| {} | {} | {:.3} | {:.4} | {:.4}{better} |",
                r.size, r.peer, r.ours_over_peer, r.rmse_ours, r.rmse_peer
            ));
            match r.peak_memory_ours_over_peer {
                Some(memory) if fit => line(format_args!(" {memory:.2} |\n")),
                None if fit => line(format_args!(" - |\n")),
                _ => line(format_args!("\n")),
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(task: Task) -> Record {
        Record {
            size: "2000x10-200",
            peer: "hpelm".to_owned(),
            task,
            ours_over_peer: 0.25,
            rmse_ours: 0.5,
            rmse_peer: 0.4,
            peak_memory_ours_over_peer: None,
        }
    }

    #[test]
    fn json_has_the_fields_that_were_promised() {
        let text = print(&[record(Task::TimeToError)], "", Format::Json).unwrap();
        let list: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(
            list,
            serde_json::json!([{"size": "2000x10-200", "peer": "hpelm", "task": "time_to_error",
                "ours_over_peer": 0.25, "rmse_ours": 0.5, "rmse_peer": 0.4}])
        );
    }

    #[test]
    fn the_table_says_where_a_peer_has_the_smaller_error() {
        let text = print(&[record(Task::Fit)], "numpy", Format::Table).unwrap();
        assert!(text.contains("0.4000 (peer) | - |"), "{text}");
    }
}
