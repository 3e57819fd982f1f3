#![no_main]

elm_fuzz::target!("rgl");
