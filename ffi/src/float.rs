//! The processor's treatment of denormal numbers.

/// Makes this thread flush denormal results to zero and read denormal operands as zero.
///
/// Embree asks for it on every tracing thread, and is slower without it: hand it to
/// rayon as `start_handler(|_| lunette_ffi::flush_to_zero())`. On x86-64 it sets bits 15
/// (FTZ) and 6 (DAZ) of MXCSR; elsewhere it does nothing. It holds until the thread ends.
pub fn flush_to_zero() {
    #[cfg(target_arch = "x86_64")]
    {
        /// Flush-to-zero and denormals-are-zero.
        const FTZ_AND_DAZ: u32 = 1 << 15 | 1 << 6;
        let mut control: u32 = 0;
        // SAFETY: stmxcsr writes and ldmxcsr reads the four bytes of `control`, which
        // outlive the block. Only the two bits above are changed: rounding and exception
        // masks, which compiled code relies on, stay as they are, and every x86-64
        // processor with AVX (Embree's least) has both bits.
        unsafe {
            std::arch::asm!("stmxcsr [{0}]", in(reg) &mut control, options(nostack, preserves_flags));
            control |= FTZ_AND_DAZ;
            std::arch::asm!("ldmxcsr [{0}]", in(reg) &control, options(nostack, preserves_flags));
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use std::hint::black_box;

    #[test]
    fn denormals_vanish_on_the_thread_that_asked_and_only_there() {
        let halve = || black_box(f32::MIN_POSITIVE) * black_box(0.5);
        let flushed = std::thread::spawn(move || {
            super::flush_to_zero();
            halve()
        });
        assert_eq!(flushed.join().expect("thread"), 0.0);
        assert!(halve() > 0.0);
    }
}
