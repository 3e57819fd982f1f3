//! The figures as a page.

use std::fmt::Write;

use super::peers::{Figure, METHODS};
use super::{OURS, Own};

/// A table's name with its rows and inputs.
pub type SizedTable = (String, (usize, usize));

/// The figures of all tables and splits.
#[derive(Debug, Default)]
pub struct Figures {
    /// Theirs, and ours.
    pub all: Vec<Figure>,
    /// What else is known of ours.
    pub own: Vec<Own>,
}

impl Figures {
    fn mean(&self, table: &str, method: &str, of: fn(&Figure) -> f64) -> Option<f64> {
        let values: Vec<f64> = self
            .all
            .iter()
            .filter(|f| f.table == table && f.method == method)
            .map(of)
            .collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    }

    /// Geometric mean over tables of the means over splits of ratios of `method` to `other`.
    fn ratio(&self, tables: &[&str], method: &str, other: &[&str]) -> Option<(f64, f64, usize)> {
        let (mut logs, mut worst, mut won) = (Vec::new(), 0.0_f64, 0);
        for table in tables {
            let mut own = Vec::new();
            for figure in self
                .all
                .iter()
                .filter(|f| f.table == *table && f.method == method)
            {
                let same = |f: &&Figure| f.table == *table && f.split == figure.split;
                let others = self.all.iter().filter(same);
                let others = others.filter(|f| other.contains(&f.method.as_str()));
                let best = others.map(|f| f.rmse).fold(f64::INFINITY, f64::min);
                if best.is_finite() {
                    own.push((figure.rmse / best).ln());
                }
            }
            if own.is_empty() {
                continue;
            }
            let log = own.iter().sum::<f64>() / own.len() as f64;
            worst = worst.max(log.exp());
            won += usize::from(log < 0.0);
            logs.push(log);
        }
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        (!logs.is_empty()).then(|| (mean.exp(), worst, won))
    }

    /// The page.
    #[must_use]
    pub fn page(&self, tables: &[SizedTable], splits: u64, command: &str) -> String {
        let mut page = format!(
            "# Real tables\n\n    {command} --splits {splits}\n\nTest RMSE over the standard deviation of the test \
             targets, mean of {splits} splits of three quarters of the rows, 5,000 at most, and the \
             rest. `auto` is `ElmParams::auto()`, `quick` its quick level; the others are \
             scikit-learn's, settings chosen on a quarter of the training rows \
             (`benches/peers/tables.py`). In brackets the seconds of processor time, one \
             thread each.\n\n| table | rows x inputs |"
        );
        let methods: Vec<&str> = OURS.into_iter().chain(METHODS).collect();
        for method in &methods {
            let _ = write!(page, " {method} |");
        }
        let _ = writeln!(page, "\n|---|---|{}", "---|".repeat(methods.len()));
        for (table, (rows, inputs)) in tables {
            let _ = write!(page, "| {table} | {rows} x {inputs} |");
            for method in &methods {
                let both = (
                    self.mean(table, method, |f| f.rmse),
                    self.mean(table, method, |f| f.seconds),
                );
                match both {
                    (Some(rmse), Some(seconds)) => {
                        let _ = write!(page, " {rmse:.4} ({seconds:.1}) |");
                    }
                    _ => page.push_str(" |"),
                }
            }
            page.push('\n');
        }
        self.ratios(&mut page, tables);
        self.checks(&mut page);
        page
    }

    fn ratios(&self, page: &mut String, tables: &[SizedTable]) {
        let all: Vec<&str> = tables.iter().map(|(name, _)| name.as_str()).collect();
        let without: Vec<&str> = all
            .iter()
            .copied()
            .filter(|name| *name != "meats")
            .collect();
        page.push_str(
            "\nError of `auto` over that of others, geometric mean over tables and splits; the \
             table meats (spectra) changes a mean by itself, so it is given without it, too.\n\n\
             | over | all | without meats | worst table | tables won |\n|---|---|---|---|---|\n",
        );
        let best: &[&str] = &["HistGB", "MLP", "KRR"];
        let rows = METHODS.iter().chain(&OURS[1..]).map(|m| (*m, vec![*m]));
        for (name, others) in rows.chain([("best of HistGB, MLP, KRR", best.to_vec())]) {
            let ratio = |tables: &[&str]| self.ratio(tables, OURS[0], &others);
            if let (Some((mean, worst, won)), Some((few, _, _))) = (ratio(&all), ratio(&without)) {
                let _ = writeln!(
                    page,
                    "| {name} | {mean:.3} | {few:.3} | {worst:.2} | {won} |"
                );
            }
        }
        let seconds = |method: &str| {
            let times = tables.iter().filter_map(|(t, _)| {
                let own = self.mean(t, OURS[0], |f| f.seconds)?;
                Some((own / self.mean(t, method, |f| f.seconds)?).ln())
            });
            let times: Vec<f64> = times.collect();
            (times.iter().sum::<f64>() / times.len().max(1) as f64).exp()
        };
        let _ = writeln!(
            page,
            "\nTime of `auto` over that of HistGB, geometric mean over tables: {:.2}; over MLP {:.2}, \
             over KRR {:.2}.",
            seconds("HistGB"),
            seconds("MLP"),
            seconds("KRR")
        );
    }

    fn checks(&self, page: &mut String) {
        for name in OURS {
            let own: Vec<&Own> = self
                .own
                .iter()
                .filter(|o| o.figure.method == name)
                .collect();
            let left_out: Vec<f64> = own.iter().filter_map(|o| o.over_left_out).collect();
            if left_out.is_empty() {
                continue;
            }
            let mean = left_out.iter().map(|r| r.ln()).sum::<f64>() / left_out.len() as f64;
            let ends = left_out
                .iter()
                .fold((f64::MAX, 0.0_f64), |e, &r| (e.0.min(r), e.1.max(r)));
            let outside = own.iter().fold(0.0_f64, |m, o| m.max(o.outside));
            let _ = writeln!(
                page,
                "\n`{name}`: test error over leave-one-out error {:.3} (geometric mean over tables and \
                 splits, from {:.2} to {:.2}). With one input moved 10 or 1e6 deviations away, no \
                 prediction leaves the range of the training targets by more than {outside:.2} of it.",
                mean.exp(),
                ends.0,
                ends.1,
            );
        }
    }
}
