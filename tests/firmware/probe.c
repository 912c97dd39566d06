/* A small program for the emulated board's own tests: what it does is known to the cycle.
 *
 * One-letter commands at 250000 baud; every answer ends with a newline.
 *   p<n>   n (a binary byte) pulses on X: 32 cycles high, 160 cycles from rise to rise, DIR low
 *   n<n>   the same with DIR high
 *   e      echo mode: every byte comes back until a 0x04 does
 *   s      silence: interrupts off for 2 ms, so that the receiver overruns
 *   r      "<mcusr> <counter> <spoiled>" in hex: reset flags, a counter in .noinit, whether it was lost
 *   l      levels of the limit pins X Y Z and of A0, as four digits
 *   w      turns the watchdog on and hangs
 *   t<n>   n pulses on Y, one each timer1 compare interrupt, 640 cycles apart
 *   g      one 1500 us pulse on A3, as a servo's
 *   d      uses 300 bytes of stack */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <stdint.h>
#include <util/delay.h>

static volatile uint8_t ring[128], head, tail;
static volatile uint8_t left;
uint16_t survivor __attribute__((section(".noinit")));
uint16_t check __attribute__((section(".noinit")));
static uint8_t flags, spoiled;

ISR(USART_RX_vect) { ring[head++ & 127] = UDR0; }

ISR(TIMER1_COMPA_vect) {
    PORTD |= 1 << 3;
    if (--left == 0)
        TIMSK1 = 0;
    _delay_us(2);
    PORTD &= ~(1 << 3);
}

static uint8_t get(void) {
    while (head == tail) {}
    return ring[tail++ & 127];
}

static void put(uint8_t c) {
    while (!(UCSR0A & (1 << UDRE0))) {}
    UDR0 = c;
}

static void put_hex(uint16_t v, uint8_t digits) {
    while (digits--)
        put("0123456789abcdef"[v >> 4 * digits & 15]);
}

/* Exactly 160 cycles from rise to rise. */
static void __attribute__((noinline)) pulses(uint8_t n) {
    cli();
    __asm__ volatile(
        "1: sbi %[port], 2  \n\t"     /* 2 */
        "ldi r18, 10        \n\t"     /* 1, then 10 * 3 - 1 = 29: 32 cycles high */
        "2: dec r18         \n\t"
        "brne 2b            \n\t"
        "cbi %[port], 2     \n\t"     /* 2 */
        "ldi r18, 41        \n\t"     /* 1, then 41 * 3 - 1 = 122 */
        "3: dec r18         \n\t"
        "brne 3b            \n\t"
        "dec %[n]           \n\t"     /* 1 */
        "brne 1b            \n\t"     /* 2: 32 + 2 + 1 + 122 + 1 + 2 = 160 */
        : [n] "+r"(n)
        : [port] "I"(_SFR_IO_ADDR(PORTD))
        : "r18");
    sei();
}

static uint8_t __attribute__((noinline)) deep(void) {
    volatile uint8_t used[300];
    for (uint16_t i = 0; i < sizeof used; i++)
        used[i] = (uint8_t)i;
    return used[299];
}

int main(void) {
    flags = MCUSR;
    MCUSR = 0;
    wdt_disable();
    spoiled = check != (uint16_t)~survivor;
    survivor = spoiled ? 1 : survivor + 1;
    check = ~survivor;
    DDRD = 1 << 2 | 1 << 3 | 1 << 5 | 1 << 6;
    DDRB = 1;                                   /* ENABLE low: on */
    PORTB = 1 << 1 | 1 << 2 | 1 << 3;           /* pull-ups of the limit pins */
    DDRC = 1 << 3;
    PORTC = 1;
    UBRR0 = 3;                                  /* 250000 baud at 16 MHz */
    UCSR0B = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0;
    TCCR1B = 1 << WGM12 | 1;
    OCR1A = 639;
    sei();
    for (;;) {
        uint8_t command = get();
        switch (command) {
        case 'p':
        case 'n':
            if (command == 'n')
                PORTD |= 1 << 5;
            else
                PORTD &= ~(1 << 5);
            pulses(get());
            break;
        case 'e':
            for (uint8_t c; (c = get()) != 4;)
                put(c);
            break;
        case 's':
            cli();
            _delay_ms(2);
            sei();
            break;
        case 'r':
            put_hex(flags, 2);
            put(' ');
            put_hex(survivor, 4);
            put(' ');
            put_hex(spoiled, 1);
            break;
        case 'l':
            PORTB |= 1;                         /* a write to the port: pull-ups must not win over drives */
            PORTB &= ~1;
            put('0' + (PINB >> 1 & 1));
            put('0' + (PINB >> 2 & 1));
            put('0' + (PINB >> 3 & 1));
            put('0' + (PINC & 1));
            break;
        case 'w':
            wdt_enable(WDTO_15MS);
            for (;;) {}
        case 't':
            left = get();
            TCNT1 = 0;
            TIFR1 = 1 << OCF1A;
            TIMSK1 = 1 << OCIE1A;
            while (TIMSK1) {}
            break;
        case 'g':
            cli();
            PORTC |= 1 << 3;
            _delay_us(1500);
            PORTC &= ~(1 << 3);
            sei();
            break;
        case 'd':
            put_hex(deep(), 2);
            break;
        default:
            put('?');
        }
        put('\n');
    }
}
