#![no_main]

elm_fuzz::target!("curet_values");
