//! placeholder
#![allow(clippy::print_stdout)]
use elm_benches::stress::*;
fn main() {
    let settings = Settings { seeds: 5, methods: Method::ALL.to_vec(), reference: std::env::args().nth(1).is_some() };
    for precision in [Precision::F64, Precision::F32] {
        println!("{precision:?}");
        for case in cases::CASES {
            let start = std::time::Instant::now();
            let records = run(&[*case], precision, &settings);
            println!("{:40} {:?} {:.2}s", case.name, records[0].shape, start.elapsed().as_secs_f64());
            for r in records {
                println!("      {:15} rmse {:9.2e} ratio {:8.3} worst {:9.3} ref {:8.1e} {} {}", r.solver, r.rmse.unwrap_or(-1.0), r.ratio_to_oracle.unwrap_or(-1.0), r.worst_ratio.unwrap_or(-1.0), r.reference_error.unwrap_or(-1.0), r.report.map_or(String::new(), |r| format!("rank {:?} cond {:.1e} lambda {:.1e} dof {:.1} {:?}", r.rank, r.condition.unwrap_or(0.0), r.lambda, r.degrees_of_freedom, r.route)), r.error.unwrap_or_default());
            }
        }
    }
}
