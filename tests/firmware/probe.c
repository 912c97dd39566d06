/* A small program for the emulated board's own tests: what it does is known to the cycle.
 *
 * One-letter commands at 250000 baud (DIVIDER: another rate); every answer ends with a newline.
 *   p<n>   n (a binary byte) pulses on X: 32 cycles high, 160 cycles from rise to rise, DIR low
 *   n<n>   the same with DIR high
 *   e      echo mode: every byte comes back until a 0x04 does
 *   s      silence: interrupts off for 2 ms, so that the receiver overruns
 *   r      "<mcusr> <counter> <spoiled>" in hex: reset flags, a counter in .noinit, whether it was lost
 *   l      levels of the limit pins X Y Z and of the abort pin, as four digits
 *   w      turns the watchdog on and hangs
 *   t<n>   n pulses on Y, one each timer1 compare interrupt, 640 cycles apart
 *   f      waits for timer1's compare flag, puts X DIR high, enables the interrupt: one pulse on Y
 *   g      one 1500 us pulse on A3 (RAMPS: D11), as a servo's
 *   v<n>   writes n to the EEPROM; V reads it back, in hex
 *   d      uses 300 bytes of stack */
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <stdint.h>
#include <util/delay.h>

#ifdef __AVR_ATmega2560__ /* RAMPS 1.4 */
#define USART_RX_vect USART0_RX_vect
#define PORT_STEP PORTF
#define X_STEP 0
#define X_DIR 1
#define Y_STEP 6
#define LEVELS (PINE >> 5 & 1), (PINJ >> 1 & 1), (PIND >> 3 & 1), (PINF >> 3 & 1)
#define SERVO_PORT PORTB
#define SERVO 5
#else /* CNC Shield V3 */
#define PORT_STEP PORTD
#define X_STEP 2
#define X_DIR 5
#define Y_STEP 3
#define LEVELS (PINB >> 1 & 1), (PINB >> 2 & 1), (PINB >> 3 & 1), (PINC & 1)
#define SERVO_PORT PORTC
#define SERVO 3
#endif

#ifndef DIVIDER
#define DIVIDER 3 /* 250000 baud at 16 MHz */
#endif

static volatile uint8_t ring[128], head, tail;
static volatile uint8_t left;
uint16_t survivor __attribute__((section(".noinit")));
uint16_t check __attribute__((section(".noinit")));
static uint8_t flags, spoiled;

ISR(USART_RX_vect) { ring[head++ & 127] = UDR0; }

ISR(TIMER1_COMPA_vect) {
    PORT_STEP |= 1 << Y_STEP;
    if (--left == 0)
        TIMSK1 = 0;
    _delay_us(2);
    PORT_STEP &= ~(1 << Y_STEP);
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
        "1: sbi %[port], %[pin]  \n\t"     /* 2 */
        "ldi r18, 10        \n\t"     /* 1, then 10 * 3 - 1 = 29: 32 cycles high */
        "2: dec r18         \n\t"
        "brne 2b            \n\t"
        "cbi %[port], %[pin]\n\t"     /* 2 */
        "ldi r18, 41        \n\t"     /* 1, then 41 * 3 - 1 = 122 */
        "3: dec r18         \n\t"
        "brne 3b            \n\t"
        "dec %[n]           \n\t"     /* 1 */
        "brne 1b            \n\t"     /* 2: 32 + 2 + 1 + 122 + 1 + 2 = 160 */
        : [n] "+r"(n)
        : [port] "I"(_SFR_IO_ADDR(PORT_STEP)), [pin] "I"(X_STEP)
        : "r18");
    sei();
}

static uint8_t __attribute__((noinline)) deep(void) {
    volatile uint8_t used[300];
    for (uint16_t i = 0; i < sizeof used; i++)
        used[i] = (uint8_t)i;
    return used[299];
}

/* Outputs, ENABLE low (on), pull-ups at the limit pins and the abort input. */
static void __attribute__((noinline)) set_pins(void) {
#ifdef __AVR_ATmega2560__
    DDRF = 1 << X_STEP | 1 << X_DIR | 1 << Y_STEP | 1 << 7;
    PORTF |= 1 << 3;
    DDRD = 1 << 7;
    PORTD = 1 << 3;
    DDRB = 1 << SERVO;
    PORTE |= 1 << 5;
    PORTJ |= 1 << 1;
#else
    DDRD = 1 << X_STEP | 1 << X_DIR | 1 << Y_STEP | 1 << 6;
    DDRB = 1;
    PORTB = 1 << 1 | 1 << 2 | 1 << 3;
    DDRC = 1 << SERVO;
    PORTC |= 1;
#endif
}

int main(void) {
    flags = MCUSR;
    MCUSR = 0;
#ifndef FORGETFUL
    wdt_disable();
#endif
    spoiled = check != (uint16_t)~survivor;
    survivor = spoiled ? 1 : survivor + 1;
    check = ~survivor;
    set_pins();
    UBRR0 = DIVIDER;
#ifdef DOUBLE
    UCSR0A = 1 << U2X0;
#endif
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
                PORT_STEP |= 1 << X_DIR;
            else
                PORT_STEP &= ~(1 << X_DIR);
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
            set_pins();                         /* writing the ports must not put pull-ups over driven pins */
            for (uint8_t i = 0, level[] = {LEVELS}; i < 4; i++)
                put('0' + level[i]);
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
        case 'f':
            left = 1;
            TIFR1 = 1 << OCF1A;
            while (!(TIFR1 & 1 << OCF1A)) {}
            PORT_STEP |= 1 << X_DIR;
            TIMSK1 = 1 << OCIE1A;
            while (TIMSK1) {}
            break;
        case 'g':
            cli();
            SERVO_PORT |= 1 << SERVO;
            _delay_us(1500);
            SERVO_PORT &= ~(1 << SERVO);
            sei();
            break;
        case 'v':
            eeprom_write_byte((uint8_t *)5, get());
            eeprom_busy_wait();
            break;
        case 'V':
            put_hex(eeprom_read_byte((uint8_t *)5), 2);
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
