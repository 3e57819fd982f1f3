#![no_main]

elm_fuzz::target!("classifier");
