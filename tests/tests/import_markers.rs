use sinew_host::import::take::{TakeOptions, read_take};
use sinew_host::take::Take;
#[test]
fn probe() {
    let mut files = Vec::new();
    for d in [
        "c3d",
        "c3d_testsuite",
        "c3d_testsuite/sample01",
        "c3d_testsuite/sample02",
        "c3d_testsuite/sample08",
        "trc",
        "motive",
        "face",
    ] {
        let Some(p) = sinew_tests::shared(d) else {
            continue;
        };
        let mut l: Vec<_> = std::fs::read_dir(p)
            .unwrap()
            .map(|e| e.unwrap().path())
            .filter(|p| p.is_file())
            .collect();
        l.sort();
        files.extend(l);
    }
    for f in files {
        match read_take(&f, &TakeOptions::default()) {
            Ok(r) => {
                let (t, n) = Take::from_raw(&r).unwrap();
                let inner = (0..t.marker_count())
                    .map(|m| {
                        t.gaps(m)
                            .filter(|g| g.start > 0 && g.end < t.frame_count())
                            .count()
                    })
                    .sum::<usize>();
                let all = (0..t.marker_count())
                    .map(|m| t.gaps(m).count())
                    .sum::<usize>();
                let longest = (0..t.marker_count())
                    .flat_map(|m| t.gaps(m).map(|g| g.len()))
                    .max();
                println!(
                    "{} {}x{} @{} first {} {} {} missing raw {:.4} take {} miss {:.4} gaps {} inner {} longest {:?} events {} analog {:?} rb {} bounds {:?}",
                    f.file_name().unwrap().to_string_lossy(),
                    r.point_count(),
                    r.frame_count,
                    r.rate,
                    r.first_frame,
                    r.unit.symbol(),
                    r.up.symbol(),
                    r.missing_count() as f64 / (r.positions.len().max(1) as f64),
                    t.marker_count(),
                    t.missing_fraction(),
                    all,
                    inner,
                    longest,
                    r.events.len(),
                    r.analog,
                    r.rigid_bodies.len(),
                    t.bounds()
                );
                for x in r.notices.iter().chain(&n) {
                    println!("      {:?} {}", x.place, x.text);
                }
            }
            Err(e) => println!("{e}"),
        }
    }
}
