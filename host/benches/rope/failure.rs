//! Figure 4.3: several neighbours vanish in one frame, come back one after the other, and for 200
//! frames the published method does not find them.

use sinew_host::studio::rope::Label;

use super::scenes::{CASES, Way, capture, error, film, run};

const START: usize = 250;
const LENGTH: usize = 200;

pub fn print() {
    println!(
        "\nFigure 4.3: 7 neighbours vanish at frame {START} and come back within {LENGTH} frames, 100 Hz"
    );
    println!(
        "{:>24} {:>10} | worst mm | all right again after frames | wrong samples",
        "", ""
    );
    for case in CASES.iter().filter(|c| c.name.contains("brisk")) {
        let take = film(case, 100.0, 3);
        let middle = take.rope[0].len() / 2;
        // From the outside in: what is left in the middle is known least.
        let back = |marker: usize| START + LENGTH - 40 * marker.abs_diff(middle);
        let hidden = |frame: usize, marker: usize| {
            marker.abs_diff(middle) <= 3 && (START..back(marker)).contains(&frame)
        };
        let shown = capture(&take, 0.0005, &hidden);
        for way in Way::ALL {
            let trace = run(&shown, way);
            let (mut worst, mut wrong, mut last_wrong) = (0.0_f64, 0, START);
            for frame in START..take.rope.len() {
                for marker in 0..take.rope[0].len() {
                    worst = worst.max(error(&trace, &take, frame, marker));
                    let point = trace.frames[frame][marker].point();
                    let label = point.map(|p| shown.frames[frame].labels[p]);
                    let right = match label {
                        Some(label) => label == Label::Rope(marker),
                        None => hidden(frame, marker),
                    };
                    if !right {
                        last_wrong = frame;
                    }
                    wrong += usize::from(label.is_some_and(|l| l != Label::Rope(marker)));
                }
            }
            let after = if last_wrong + 1 == take.rope.len() {
                "never".to_owned()
            } else {
                last_wrong.saturating_sub(START + LENGTH).to_string()
            };
            println!(
                "{:>24} {:>10} | {:8.0} | {after:>28} | {wrong}",
                case.name,
                way.name(),
                1e3 * worst
            );
        }
    }
}
